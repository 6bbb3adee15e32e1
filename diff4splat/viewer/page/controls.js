// Mouse, touch and keys; every change asks for a new frame.
function startControls(canvas, camera, actions) {
  const pointers = new Map(), held = new Set();
  let pinch = 0;
  const moved = () => { actions.leavePath(); actions.redraw(); };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
    pinch = spread(pointers);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const right = event.clientX - before.clientX, down = event.clientY - before.clientY;
    pointers.set(event.pointerId, event);
    const scale = Math.max(canvas.clientWidth, canvas.clientHeight);
    if (pointers.size > 1) {
      const now = spread(pointers), lens = camera.lens([canvas.clientWidth, canvas.clientHeight]);
      camera.pan(right / 2 * camera.focalPx[0] / lens.focal[0], down / 2 * camera.focalPx[0] / lens.focal[0]);
      if (pinch && now) camera.zoom(pinch / now);
      pinch = now;
    } else if (event.shiftKey || event.buttons & 6) {
      const lens = camera.lens([canvas.clientWidth, canvas.clientHeight]);
      camera.pan(right * camera.focalPx[0] / lens.focal[0], down * camera.focalPx[0] / lens.focal[0]);
    } else {
      camera.orbit(3 * right / scale, 3 * down / scale);
    }
    moved();
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => { pointers.delete(event.pointerId); pinch = spread(pointers); });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(clamp(event.deltaY, -240, 240) * 1e-3));
    moved();
  }, { passive: false });

  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|SELECT/.test(event.target.tagName)) return;
    const name = event.key.toLowerCase(), key = event.shiftKey && name.startsWith("arrow") ? `shift ${name}` : name;
    if (key === " " && event.target.tagName === "BUTTON") return;
    if (key in FLIGHT) held.add(key);
    else if (key in actions.keys) {
      event.preventDefault();
      actions.keys[key]();
    }
  });
  addEventListener("keyup", (event) => held.delete(event.key.toLowerCase()));
  addEventListener("blur", () => held.clear());

  return function fly(seconds) {
    if (!held.size) return;
    const step = [...held].map((key) => FLIGHT[key]).reduce(add);
    camera.fly(scaled(step, 0.5 * seconds));
    moved();
  };
}

const FLIGHT = { w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, 1, 0], e: [0, -1, 0] };

function spread(pointers) {
  if (pointers.size < 2) return 0;
  const [a, b] = [...pointers.values()];
  return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
}
