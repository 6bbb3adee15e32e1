const TEXTURE_WIDTH = 2048, CLOSING_PX2 = 0.02;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
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

function largestOffset(header, scene) {
  let largest = 1;
  if (header.moving) for (const value of scene.offsets) largest = Math.max(largest, Math.abs(value));
  return largest * (header.offset_step ?? 1);
}

class Renderer {
  constructor(canvas, header, scene) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { gl, canvas, header, shown: 0, size: [0, 0] });
    this.halfFloat = Boolean(gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float"));
    this.draw = program(gl, VERTEX, FRAGMENT);
    this.copy = program(gl, COPY_VERTEX, COPY_FRAGMENT);
    integerTexture(gl, 1, canonicalWords(scene, header.count));
    keyTexture(gl, 2, header, scene);
    integerTexture(gl, 3, harmonicWords(scene, header));
    this.orderTexture = texture(gl, 0, gl.TEXTURE_2D);
    gl.bindVertexArray(gl.createVertexArray());
    const corners = new Uint16Array(BATCH * 6);
    for (let i = 0; i < BATCH; i++) corners.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner), 6 * i);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.disable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.setConstants(header, scene);
  }

  uniform(name, kind, ...values) {
    this.gl[`uniform${kind}`](this.gl.getUniformLocation(this.draw, name), ...values);
  }

  setConstants(header, scene) {
    this.gl.useProgram(this.draw);
    ["order", "canonical", "keys", "harmonics"].forEach((name, unit) => this.uniform(name, "1i", unit));
    this.uniform("moving", "1i", header.moving);
    this.uniform("harmonicCount", "1i", header.harmonics);
    this.uniform("offsetStep", "1f", header.offset_step ?? 0);
    this.uniform("logScaleStep", "1f", header.log_scale_step ?? 0);
    this.uniform("harmonicsStep", "1f", header.harmonics_step ?? 0);
    this.uniform("near", "1f", NEAR);
    this.uniform("largestOffset", "1f", largestOffset(header, scene));
    this.uniform("colorLow", "3fv", header.color_range[0]);
    this.uniform("colorHigh", "3fv", header.color_range[1]);
  }

  setOrder(sorted) {
    const { gl } = this, rows = Math.max(1, Math.ceil(sorted.length / TEXTURE_WIDTH));
    const padded = new Uint32Array(rows * TEXTURE_WIDTH);
    padded.set(sorted);
    gl.activeTexture(gl.TEXTURE0);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, TEXTURE_WIDTH, rows, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, padded);
    this.shown = sorted.length;
  }

  resize() {
    const ratio = this.exactSize ? 1 : Math.min(devicePixelRatio || 1, 2), { gl, canvas } = this;
    const size = this.exactSize ?? [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (size[0] === this.size[0] && size[1] === this.size[1]) return;
    this.size = [canvas.width, canvas.height] = size.map((side) => Math.max(1, side));
    if (!this.halfFloat) return;
    texture(gl, 4, gl.TEXTURE_2D);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, ...this.size, 0, gl.RGBA, gl.HALF_FLOAT, null);
    this.target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    const made = gl.getParameter(gl.TEXTURE_BINDING_2D);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made, 0);
    this.halfFloat = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
  }

  render(camera, blend, mode, depthRange) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.halfFloat ? this.target : null);
    gl.viewport(0, 0, ...this.size);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.useProgram(this.draw);
    this.uniform("count", "1i", this.shown);
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
    gl.drawElementsInstanced(gl.TRIANGLES, BATCH * 6, gl.UNSIGNED_SHORT, 0, Math.ceil(this.shown / BATCH));
    if (this.halfFloat) this.present();
  }

  present() {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.BLEND);
    gl.useProgram(this.copy);
    gl.uniform1i(gl.getUniformLocation(this.copy, "image"), 4);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
