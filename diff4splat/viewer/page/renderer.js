const TEXTURE_WIDTH = 2048, CLOSING_PX2 = 0.02;

// Compiling goes on in the background until the first question about the program.
function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  return made;
}

function requireLinked(gl, made) {
  if (gl.getProgramParameter(made, gl.LINK_STATUS) || gl.isContextLost()) return;
  const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
  throw new Error(`the graphics driver refuses a shader: ${[gl.getProgramInfoLog(made), ...logs].join(" ").trim()}`);
}

function texture(gl, unit, target) {
  const made = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(target, made);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, name, gl.NEAREST);
  return made;
}

// Rows of 2048 texels of four words; the last row is padded.
function integerTexture(gl, unit, words) {
  const rows = Math.max(1, Math.ceil(words.length / (4 * TEXTURE_WIDTH)));
  const padded = new Uint32Array(rows * TEXTURE_WIDTH * 4);
  padded.set(words);
  texture(gl, unit, gl.TEXTURE_2D);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, TEXTURE_WIDTH, rows, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, padded);
}

function canonicalWords(scene, count) {
  const words = new Uint32Array(8 * count), means = new Uint32Array(scene.means.buffer);
  const { colors, opacities, logScales, quats } = scene;
  for (let i = 0, j = 0, at = 0; i < count; i++, j += 3, at += 8) {
    words[at] = means[j]; words[at + 1] = means[j + 1]; words[at + 2] = means[j + 2];
    words[at + 3] = colors[j] | (colors[j + 1] << 8) | (colors[j + 2] << 16) | (opacities[i] << 24);
    words[at + 4] = quats[i];
    words[at + 5] = (logScales[j] & 0xffff) | (logScales[j + 1] << 16);
    words[at + 6] = logScales[j + 2] & 0xffff;
  }
  return words;
}

function keyTexture(gl, unit, header, scene) {
  const { moving } = header, layers = moving ? header.key_times_s.length : 1;
  const rows = Math.max(1, Math.ceil(moving / TEXTURE_WIDTH)), words = new Uint32Array(rows * TEXTURE_WIDTH * 4 * layers);
  const { offsets: o, logScaleOffsets: s, rotations } = scene;
  for (let layer = 0; layer < layers && moving; layer++) {
    for (let i = 0; i < moving; i++) {
      const j = 3 * (layer * moving + i), at = 4 * (layer * rows * TEXTURE_WIDTH + i);
      words[at] = (o[j] & 0xffff) | (o[j + 1] << 16);
      words[at + 1] = (o[j + 2] & 0xffff) | (s[j] << 16);
      words[at + 2] = (s[j + 1] & 0xffff) | (s[j + 2] << 16);
      words[at + 3] = rotations[layer * moving + i];
    }
  }
  texture(gl, unit, gl.TEXTURE_2D_ARRAY);
  gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA32UI, TEXTURE_WIDTH, rows, layers, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, words);
}

// Three texels of sixteen signed bytes each.
function harmonicWords(scene, header) {
  const perItem = header.harmonics * 3;
  if (!perItem) return new Uint32Array(4);
  const bytes = new Uint8Array(48 * header.count);
  for (let i = 0; i < header.count; i++) bytes.set(scene.harmonics.subarray(i * perItem, (i + 1) * perItem), 48 * i);
  return new Uint32Array(bytes.buffer);
}

// Footprints follow the camera: in a larger image the scene keeps its look (docs/reference/rendering.md).
function dilationPx2(header, camera) {
  const own = header.dilation_px2, growth = Math.max(camera.focal[0] / header.path.focal_px[0][0], 1) ** 2;
  return own * growth + (own < CLOSING_PX2 ? CLOSING_PX2 * (growth - 1) : 0);
}

// Nearly the largest displacement: one outlier alone does not decide the colours of all.
function displacementRange(header, { offsets }) {
  const lengths = [], step = 3 * Math.max(1, Math.floor((offsets?.length ?? 0) / 60000));
  for (let i = 0; offsets && i < offsets.length; i += step) lengths.push(Math.hypot(offsets[i], offsets[i + 1], offsets[i + 2]));
  lengths.sort((a, b) => a - b);
  return Math.max(1, lengths[Math.floor(0.995 * lengths.length)] ?? 1) * (header.offset_step ?? 1);
}

// What the scene needs, and what this device has.
function requireRoom(gl, { count, moving, key_times_s: times = [] }) {
  const texels = Math.max(2 * count, moving), side = gl.getParameter(gl.MAX_TEXTURE_SIZE), layers = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS);
  if (texels > side * TEXTURE_WIDTH) {
    throw new Error(`${count.toLocaleString()} Gaussians are too many for the graphics of this device, which holds ${Math.floor(side * TEXTURE_WIDTH / 2).toLocaleString()}`);
  }
  if (times.length > layers) throw new Error(`${times.length} key times are too many for the graphics of this device, which holds ${layers}`);
}

class Renderer {
  constructor(canvas, header) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2, or it is switched off. A current Firefox, Chrome, Edge or Safari has it; in its settings, hardware acceleration may have to be on");
    requireRoom(gl, header);
    Object.assign(this, { gl, canvas, header, order: new Uint32Array(0) });
    this.build();
  }

  // All that is lost with the context, but the scene's textures.
  build() {
    const { gl, header } = this;
    Object.assign(this, { size: [0, 0], places: new Map(), imagePlace: undefined, image: null, target: null });
    this.halfFloat = Boolean(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"));
    this.draw = program(gl, vertexShader(header.harmonics), FRAGMENT);
    this.copy = program(gl, COPY_VERTEX, COPY_FRAGMENT);
    gl.bindVertexArray(gl.createVertexArray());
    const corners = new Uint16Array(BATCH * 6);
    for (let i = 0; i < BATCH; i++) corners.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner), 6 * i);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.disable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.orderTexture = texture(gl, 0, gl.TEXTURE_2D);
    gl.flush();
  }

  // Draws nothing, with all parts in place: the driver prepares itself while the scene is unpacked.
  warmUp() {
    const { gl } = this;
    for (const unit of [0, 1, 2, 3]) {
      if (unit) texture(gl, unit, unit === 2 ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D);
      const word = [gl.RGBA_INTEGER, gl.UNSIGNED_INT, new Uint32Array(4)];
      if (unit === 2) gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA32UI, 1, 1, 1, 0, ...word);
      else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, 1, 1, 0, ...word);
    }
    this.setConstants(this.header);
    this.resize();
    this.drawBatches(0, 1);
    gl.flush();
  }

  load(scene) {
    const { gl, header } = this;
    this.scene = scene;
    this.largestOffset ??= displacementRange(header, scene);
    integerTexture(gl, 1, canonicalWords(scene, header.count));
    keyTexture(gl, 2, header, scene);
    integerTexture(gl, 3, harmonicWords(scene, header));
    for (const made of [this.draw, this.copy]) requireLinked(gl, made);
    this.setConstants(header);
  }

  // After the browser took the graphics away and gave them back.
  restore() {
    this.build();
    if (this.scene) this.load(this.scene);
    this.setOrder(this.order);
  }

  uniform(name, kind, ...values) {
    const { gl, places } = this;
    if (!places.has(name)) places.set(name, gl.getUniformLocation(this.draw, name));
    gl[`uniform${kind}`](places.get(name), ...values);
  }

  setConstants(header) {
    this.gl.useProgram(this.draw);
    ["order", "canonical", "keys", "harmonics"].forEach((name, unit) => this.uniform(name, "1i", unit));
    this.uniform("moving", "1i", header.moving);
    this.uniform("offsetStep", "1f", header.offset_step ?? 0);
    this.uniform("logScaleStep", "1f", header.log_scale_step ?? 0);
    this.uniform("harmonicsStep", "1f", header.harmonics_step ?? 0);
    this.uniform("near", "1f", NEAR);
    this.uniform("largestOffset", "1f", this.largestOffset ?? 1);
    this.uniform("colorLow", "3fv", header.color_range[0]);
    this.uniform("colorHigh", "3fv", header.color_range[1]);
  }

  setOrder(sorted) {
    const { gl } = this, rows = Math.max(1, Math.ceil(sorted.length / TEXTURE_WIDTH));
    this.order = sorted;
    const padded = new Uint32Array(rows * TEXTURE_WIDTH);
    padded.set(sorted);
    gl.activeTexture(gl.TEXTURE0);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, TEXTURE_WIDTH, rows, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, padded);
  }

  // A coarse picture has fewer pixels: for slow graphics while something moves.
  resize(share = 1) {
    const ratio = Math.min(devicePixelRatio || 1, 2) * share, { gl, canvas } = this;
    const size = (this.exactSize ?? [canvas.clientWidth * ratio, canvas.clientHeight * ratio]).map((side) => Math.max(1, Math.round(side)));
    if (size[0] === this.size[0] && size[1] === this.size[1]) return false;
    this.size = [canvas.width, canvas.height] = size;
    if (this.halfFloat) this.makeTarget(gl);
    return true;
  }

  makeTarget(gl) {
    gl.deleteTexture(this.image);
    gl.deleteFramebuffer(this.target);
    this.image = texture(gl, 4, gl.TEXTURE_2D);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, ...this.size, 0, gl.RGBA, gl.HALF_FLOAT, null);
    this.target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.image, 0);
    this.halfFloat = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
  }

  render(camera, blend, mode, depthRange) {
    if (this.gl.isContextLost()) return;
    this.gl.useProgram(this.draw);
    this.uniform("mode", "1i", mode);
    this.uniform("layers", "4iv", blend.layers);
    this.uniform("weights", "4fv", blend.weights);
    this.uniform("between", "2iv", blend.between);
    this.uniform("betweenWeight", "1f", blend.weight);
    this.uniform("cameraFromWorld", "Matrix3fv", false, camera.rows.flat());
    this.uniform("position", "3fv", camera.position);
    this.uniform("focal", "2fv", camera.focal);
    this.uniform("center", "2fv", camera.center);
    this.uniform("size", "2fv", this.size);
    this.uniform("dilation", "1f", dilationPx2(this.header, camera));
    this.uniform("depthRange", "2fv", depthRange);
    this.drawBatches(this.order.length, Math.ceil(this.order.length / BATCH));
  }

  drawBatches(count, batches) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.halfFloat ? this.target : null);
    gl.viewport(0, 0, ...this.size);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.useProgram(this.draw);
    this.uniform("count", "1i", count);
    gl.drawElementsInstanced(gl.TRIANGLES, BATCH * 6, gl.UNSIGNED_SHORT, 0, batches);
    if (this.halfFloat) this.present();
  }

  present() {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.BLEND);
    gl.useProgram(this.copy);
    this.imagePlace ??= gl.getUniformLocation(this.copy, "image");
    gl.uniform1i(this.imagePlace, 4);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
