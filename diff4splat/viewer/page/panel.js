// The panel under the scene: what it shows follows the player's state, and buttons call actions.
const byId = (id) => document.getElementById(id);
const MODES = ["color", "depth", "motion"];

function startPanel(header, state, actions) {
  byId("panel").hidden = byId("hint").hidden = false;
  const [start, stop] = header.time_range_s, isStill = !(stop > start);
  Object.assign(byId("time"), { min: start, max: stop, disabled: isStill });
  for (const id of ["play", "loop", "speed"]) byId(id).disabled = isStill;
  byId("follow").disabled = header.path.times_s.length < 2;
  byId("motion").disabled = !header.moving;
  byId("time").oninput = (event) => actions.setTime(Number(event.target.value));
  byId("speed").onchange = (event) => { state.speed = Number(event.target.value); };
  MODES.forEach((id, mode) => { byId(id).onclick = () => actions.setMode(mode); });
  for (const id of ["play", "loop", "follow", "record", "reset", "theme", "help"]) byId(id).onclick = actions[id];
  // Keys belong to the scene again once the mouse or a finger has used a control.
  byId("panel").addEventListener("pointerup", () => setTimeout(() => document.activeElement.blur()));
}

function showState(state) {
  byId("time").value = state.timeS;
  byId("clock").textContent = `${state.timeS.toFixed(2)} s`;
  byId("play").classList.toggle("plays", state.isPlaying);
  const pressed = { loop: state.loops, follow: state.follows, record: state.records, help: !byId("keys").hidden };
  MODES.forEach((id, mode) => { pressed[id] = mode === state.mode; });
  for (const id in pressed) byId(id).setAttribute("aria-pressed", String(pressed[id]));
}

// Colours of depth run from near, warm, to far; those of motion from none to far, warm.
function showLegend(mode, [near, far], largest) {
  const legend = byId("legend"), digits = (value) => value.toPrecision(2) * 1;
  legend.hidden = mode === 0;
  legend.className = MODES[mode];
  byId("least").textContent = mode === 1 ? `near ${digits(near)}` : "0";
  byId("most").textContent = mode === 1 ? `${digits(far)} far` : digits(largest);
  byId("unit").textContent = `${mode === 1 ? "depth" : "displacement"}, scene units`;
}

function describe({ about, count, moving }) {
  document.title = about.title;
  byId("about").hidden = false;
  const title = document.createElement("strong"), facts = document.createElement("small");
  title.textContent = about.title;
  const lines = [];
  if (count !== undefined) lines.push(`${count.toLocaleString()} Gaussians${moving ? `, ${moving.toLocaleString()} move` : ""}`);
  if (about.model !== "none") lines.push(`model ${about.model}`);
  if (about.license !== "unknown") lines.push(`licence ${about.license}`);
  if (about.untrained) lines.push("random weights: not a trained result");
  facts.textContent = [...lines, ...about.notes].join(" · ");
  byId("about").append(title, facts);
}

function showMessage(text) {
  byId("message").textContent = text;
  byId("message").hidden = !text;
}

function toggleTheme() {
  const root = document.documentElement, isDark = matchMedia("(prefers-color-scheme: dark)").matches;
  const now = root.dataset.theme ?? (isDark ? "dark" : "light");
  root.dataset.theme = now === "dark" ? "light" : "dark";
}
