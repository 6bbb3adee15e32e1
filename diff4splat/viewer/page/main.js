// The player: state, one frame loop, and a sort whenever camera or time changed.
async function main() {
  if (!("DecompressionStream" in window)) throw new Error("this browser cannot unpack gzip; update it");
  const payload = await readPayload(), { header } = payload, scene = decodeScene(payload);
  const canvas = byId("view"), [startS, stopS] = header.time_range_s;
  const depths = depthQuantiles(header, scene, [0.02, 0.5, 0.98]), depthRange = [depths[0], Math.max(depths[2], depths[0] * 1.01)];
  const renderer = new Renderer(canvas, header, scene), camera = new OrbitCamera(header, depths[1]);
  const recorder = new Recorder(header);
  const state = { timeS: startS, isPlaying: false, loops: true, follows: false, records: false, speed: 1, mode: 0 };
  let dirty = true, asked = 0, done = 0, isSorting = false, before = performance.now(), sortMs = 0;
  const redraw = () => { dirty = true; };

  const sort = startSorter(header, scene, (answer) => {
    renderer.setOrder(answer.sorted);
    done = answer.number; sortMs = answer.milliseconds; isSorting = false; dirty = true;
    showMessage("");
  });

  const actions = {
    redraw,
    leavePath() { state.follows = false; },
    setTime(timeS) { state.timeS = clamp(timeS, startS, stopS); redraw(); },
    setMode(mode) { state.mode = mode; redraw(); },
    play() { state.isPlaying = !state.isPlaying && stopS > startS; redraw(); },
    loop() { state.loops = !state.loops; redraw(); },
    follow() { state.follows = !state.follows; redraw(); },
    reset() { state.follows = false; camera.set(pathCamera(header, header.path.times_s[0])); redraw(); },
    theme: toggleTheme,
    help() { byId("keys").hidden = !byId("keys").hidden; redraw(); },
    record() {
      if (recorder.isRecording) download("camera_path.json", recorder.stop(renderer.size));
      else recorder.start();
      state.records = recorder.isRecording; redraw();
    },
  };
  const stepS = (stopS - startS) / 48;
  actions.keys = {
    " ": actions.play, l: actions.loop, p: actions.follow, r: actions.record, 0: actions.reset, t: actions.theme, h: actions.help,
    1: () => actions.setMode(0), 2: () => actions.setMode(1), 3: () => actions.setMode(2),
    arrowleft: () => actions.setTime(state.timeS - stepS), arrowright: () => actions.setTime(state.timeS + stepS),
  };
  startPanel(header, state, actions);
  const fly = startControls(canvas, camera, actions);
  addEventListener("resize", redraw);

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
    renderer.resize();
    if (dirty) draw();
    requestAnimationFrame(frame);
  }

  function draw() {
    dirty = false;
    const view = camera.view(renderer.size), blend = blendAt(header, state.timeS);
    const key = JSON.stringify([column(view.rows, 2), view.position, blend.layers, blend.weights]);
    if (key !== asked.key && !isSorting) {
      asked = { key, number: (asked.number ?? 0) + 1 };
      isSorting = true;
      sort({ axis: column(view.rows, 2), position: view.position, near: NEAR, number: asked.number, ...blend });
    } else if (key !== asked.key) dirty = true;
    renderer.render(view, blend, state.mode, depthRange);
    showState(state);
  }

  // For tests and for pages that embed this one.
  window.diff4splat = {
    state, actions, camera, renderer, recorder,
    get isReady() { return !dirty && !isSorting && done > 0 && done === asked.number; },
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

main().catch((error) => showMessage(`The scene cannot be shown: ${error.message}`));
