// The player: state, one frame loop, and a sort whenever camera or time changed.
const SLOW_MS = 70, COARSE = 0.5, REST_MS = 250;

async function main() {
  if (!("DecompressionStream" in window)) throw new Error("this browser cannot unpack gzip; update it");
  const header = readHeader(), canvas = byId("view");
  describe(header);
  if (header.reason) throw new Error(header.reason);
  const [startS, stopS] = header.time_range_s;
  const sorter = new Sorter(header, sorted), renderer = new Renderer(canvas, header), unpacked = unpack();
  renderer.warmUp();
  const scene = decodeScene(header, await unpacked);
  sorter.load(scene);
  renderer.load(scene);
  const depths = depthQuantiles(header, scene, [0.02, 0.5, 0.98]), depthRange = [depths[0], Math.max(depths[2], depths[0] * 1.01)];
  const camera = new OrbitCamera(header, depths[1]), recorder = new Recorder(header);
  const state = { timeS: startS, isPlaying: false, loops: true, follows: false, records: false, speed: 1, mode: 0 };
  const pace = { frameMs: 0, isSlow: false, changedMs: -REST_MS, share: 1 };
  let dirty = true, asked = {}, done = 0, isSorting = false, before = performance.now(), sortMs = 0;
  const redraw = () => { dirty = true; };

  function sorted(answer) {
    renderer.setOrder(answer.sorted);
    if (!done) begin();
    done = answer.number; sortMs = answer.milliseconds; isSorting = false; dirty = true;
  }

  // What moves shows it by itself, unless the reader does not want that or this page is part of another.
  function begin() {
    showMessage("");
    if (matchMedia("(prefers-reduced-motion: reduce)").matches || parent !== window) return;
    state.isPlaying = stopS > startS;
    state.follows = state.isPlaying && header.path.times_s.length > 1;
  }

  const actions = {
    redraw,
    leavePath() { state.follows = false; byId("hint").hidden = true; },
    setTime(timeS) { state.timeS = clamp(timeS, startS, stopS); redraw(); },
    setMode(mode) { state.mode = mode; byId("hint").hidden = true; showLegend(mode, depthRange, renderer.largestOffset); redraw(); },
    play() {
      if (!state.isPlaying && !state.loops && state.timeS >= stopS) state.timeS = startS;
      state.isPlaying = !state.isPlaying && stopS > startS; redraw();
    },
    loop() { state.loops = !state.loops; redraw(); },
    follow() { state.follows = !state.follows; redraw(); },
    reset() { state.follows = false; camera.set(pathCamera(header, header.path.times_s[0])); redraw(); },
    theme: toggleTheme,
    help() { byId("keys").hidden = !byId("keys").hidden; redraw(); },
    bare() { document.body.classList.toggle("bare"); },
    record() {
      if (recorder.isRecording) download("camera_path.json", recorder.stop(renderer.size));
      else recorder.start();
      state.records = recorder.isRecording; redraw();
    },
  };
  const stepS = (stopS - startS) / 48, turn = (right, down) => () => { camera.orbit(right, down); actions.leavePath(); redraw(); };
  const zoom = (factor) => () => { camera.zoom(factor); actions.leavePath(); redraw(); };
  actions.keys = {
    " ": actions.play, l: actions.loop, p: actions.follow, r: actions.record, 0: actions.reset, t: actions.theme, h: actions.help, u: actions.bare,
    1: () => actions.setMode(0), 2: () => actions.setMode(1), 3: () => actions.setMode(2),
    arrowleft: () => actions.setTime(state.timeS - stepS), arrowright: () => actions.setTime(state.timeS + stepS),
    "shift arrowleft": turn(-0.1, 0), "shift arrowright": turn(0.1, 0), "shift arrowup": turn(0, -0.1), "shift arrowdown": turn(0, 0.1),
    "+": zoom(0.9), "=": zoom(0.9), "-": zoom(1 / 0.9),
  };
  startPanel(header, state, actions);
  const fly = startControls(canvas, camera, actions);
  addEventListener("resize", redraw);
  canvas.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    showMessage("The graphics were taken away, waiting for them …");
  });
  canvas.addEventListener("webglcontextrestored", () => { renderer.restore(); showMessage(""); redraw(); });

  function advance(seconds) {
    if (!state.isPlaying) return;
    const next = state.timeS + seconds * state.speed, length = stopS - startS;
    if (next > stopS && !state.loops) state.isPlaying = false;
    state.timeS = next > stopS ? (state.loops ? startS + (next - startS) % length : stopS) : next;
    redraw();
  }

  function frame(now) {
    const seconds = Math.min((now - before) / 1000, 0.25);
    before = now;
    advance(seconds);
    fly(seconds);
    recorder.add(seconds, camera, state.timeS, renderer.size);
    if (state.follows) camera.set(pathCamera(header, state.timeS));
    choosePace(now, seconds);
    if (renderer.resize(pace.share)) dirty = true;
    if (dirty) draw();
    requestAnimationFrame(frame);
  }

  // Slow graphics draw fewer pixels while something moves, and all of them as soon as it rests.
  function choosePace(now, seconds) {
    const moves = now - pace.changedMs < REST_MS;
    if (moves && dirty) pace.frameMs += 0.1 * (1000 * seconds - pace.frameMs);
    pace.isSlow ||= pace.frameMs > SLOW_MS;
    pace.share = moves && pace.isSlow && !renderer.exactSize ? COARSE : 1;
  }

  function draw() {
    dirty = false;
    const view = camera.view(renderer.size), blend = blendAt(header, state.timeS);
    const key = JSON.stringify([column(view.rows, 2), view.position, blend.layers, blend.weights]);
    if (key !== asked.key && !isSorting) {
      if (done) pace.changedMs = performance.now();
      asked = { key, number: (asked.number ?? 0) + 1 };
      isSorting = true;
      sorter.sort({ axis: column(view.rows, 2), position: view.position, near: NEAR, number: asked.number, ...blend });
    } else if (key !== asked.key) dirty = true;
    if (done) renderer.render(view, blend, state.mode, depthRange);
    showState(state);
  }

  // For tests and for pages that embed this one.
  window.diff4splat = {
    state, actions, camera, renderer, recorder,
    get isReady() { return !dirty && !isSorting && done > 0 && done === asked.number && pace.share === 1 && !renderer.gl.isContextLost(); },
    get sortMilliseconds() { return sortMs; },
    showPath(timeS) { actions.leavePath(); actions.setTime(timeS); camera.set(pathCamera(header, timeS)); },
    setSize(size) { renderer.exactSize = size; redraw(); },
  };
  requestAnimationFrame(frame);
}

// Depths of Gaussians in the first view, in front of the camera.
function depthQuantiles(header, scene, shares) {
  const { rows, position } = pathCamera(header, header.path.times_s[0]), axis = column(rows, 2), shift = dot(axis, position);
  const step = Math.max(1, Math.floor(header.count / 20000)), found = [];
  for (let i = 0; i < header.count; i += step) {
    const z = axis[0] * scene.means[3 * i] + axis[1] * scene.means[3 * i + 1] + axis[2] * scene.means[3 * i + 2] - shift;
    if (z > NEAR) found.push(z);
  }
  found.sort((a, b) => a - b);
  return shares.map((share) => found[Math.floor(share * (found.length - 1))] ?? 1);
}

main().catch((error) => showMessage(`The scene cannot be shown: ${error.message}.`));
