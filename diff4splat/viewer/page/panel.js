// The panel under the scene: what it shows follows the player's state, and buttons call actions.
const byId = (id) => document.getElementById(id);

function startPanel(header, state, actions) {
  byId("panel").hidden = byId("about").hidden = false;
  const [start, stop] = header.time_range_s, isStill = !(stop > start);
  Object.assign(byId("time"), { min: start, max: stop, disabled: isStill });
  for (const id of ["play", "loop", "speed"]) byId(id).disabled = isStill;
  byId("follow").disabled = header.path.times_s.length < 2;
  byId("time").oninput = (event) => actions.setTime(Number(event.target.value));
  byId("speed").onchange = (event) => { state.speed = Number(event.target.value); };
  byId("mode").onchange = (event) => actions.setMode(Number(event.target.value));
  for (const id of ["play", "loop", "follow", "record", "reset", "theme", "help"]) byId(id).onclick = actions[id];
  describe(header);
}

function showState(state) {
  byId("time").value = state.timeS;
  byId("clock").textContent = `${state.timeS.toFixed(2)} s`;
  byId("play").textContent = state.isPlaying ? "❚❚" : "▶";
  byId("mode").value = state.mode;
  for (const [id, pressed] of [["loop", state.loops], ["follow", state.follows], ["record", state.records], ["help", !byId("keys").hidden]]) {
    byId(id).setAttribute("aria-pressed", String(pressed));
  }
}

function describe({ about, count, moving }) {
  document.title = about.title;
  const title = document.createElement("strong");
  title.textContent = about.title;
  const facts = [`${count.toLocaleString()} Gaussians, ${moving.toLocaleString()} move`, `model ${about.model}`, `licence ${about.license}`];
  if (about.untrained) facts.push("random weights: not a trained result");
  byId("about").append(title, [...facts, ...about.notes].join(" · "));
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
