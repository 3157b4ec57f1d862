// Buttons, choices and keys of the page to play with.

function connectButtons(page) {
  const byId = (id) => document.getElementById(id);
  byId("play").onclick = () => page.tell({ do: page.swarm.now.paused ? "play" : "pause" });
  byId("step").onclick = () => page.tell({ do: "step" });
  byId("speed").onchange = () => page.tell({ do: "speed", value: Number(byId("speed").value) });
  byId("restart").onclick = () => {
    if (byId("seed").checkValidity()) page.tell({ do: "start", seed: Number(byId("seed").value) });
    else showNote("A seed is a whole number from 0 on.", true);
  };
  byId("seed").onkeydown = (event) => event.key === "Enter" && byId("restart").click();
  byId("save").onclick = () => page.save();
  byId("whole").onclick = () => page.showWhole();
  byId("theme").onclick = () => theme.toggle();
  byId("help").onclick = () => byId("keys").showModal();
  byId("scenario").onchange = () => page.tell({ do: "start", scenario: byId("scenario").value });
  byId("policy").onchange = () => page.tell({ do: "start", policy: byId("policy").value });
  byId("robots").oninput = () => {
    byId("robots-now").textContent = byId("robots").value;
  };
  byId("robots").onchange = () => page.tell({ do: "start", robots: Number(byId("robots").value) });
  byId("wall").onclick = () => page.drawWalls(!page.drawsWalls);
  byId("no-walls").onclick = () => page.tell({ do: "remove_walls" });
  document.addEventListener("keydown", (event) => pressPlayKey(event, page));
}

const PLAY_KEYS = {
  " ": () => document.getElementById("play").click(),
  ".": () => document.getElementById("step").click(),
  w: (page) => page.drawWalls(!page.drawsWalls),
  0: (page) => page.showWhole(),
  t: () => theme.toggle(),
  "?": () => document.getElementById("keys").showModal(),
  Escape: (page) => page.choose(-1, null),
};

function pressPlayKey(event, page) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (isTyping(event) || !Object.hasOwn(PLAY_KEYS, key)) return;
  event.preventDefault();
  PLAY_KEYS[key](page);
}

/** Let choices and sliders show what the run is made of. */
function showSetting(page, about) {
  const { header } = about;
  const { width_m, height_m, obstacles_m } = header.world;
  const facts = [`${header.n_robots} robots`, `${header.n_objects} objects`, `${width_m} × ${height_m} m`,
    `seed ${header.seed}`];
  if (obstacles_m.length > 0) facts.push(obstacles_m.length === 1 ? "1 wall" : `${obstacles_m.length} walls`);
  document.getElementById("title").textContent = `${header.label} in ${about.place.replaceAll("_", " ")}`;
  showFacts([...facts, ...about.disturbances]);
  document.getElementById("seed").value = String(header.seed);
  fill("scenario", about.scenarios.map((name) => [name, name.replaceAll("_", " ")]), header.scenario);
  fill("policy", about.policies.map((name) => [name, name.split("/").at(-1)]), about.policy);
  fill("speed", about.speeds.map((factor) => [String(factor), `${factor}×`]), document.getElementById("speed").value);
  const robots = document.getElementById("robots");
  robots.max = String(about.most_robots);
  robots.value = String(header.n_robots);
  document.getElementById("robots-now").textContent = String(header.n_robots);
  document.getElementById("no-walls").disabled = obstacles_m.length === 0;
  if (page.sliders) return;
  const card = document.getElementById("levels");
  page.sliders = Object.fromEntries(
    about.sliders.map((slider) => [slider.name, new Slider(card, slider, (value) => page.setLevel(slider.name, value))]),
  );
  card.append(Object.assign(document.createElement("p"), { id: "changes" }));
}

function fill(id, options, chosen) {
  const select = document.getElementById(id);
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value, false, value === chosen)));
}

/** Let the controls show what time it is. */
function showControls(now) {
  const play = document.getElementById("play");
  const speed = document.getElementById("speed");
  document.getElementById("clock").textContent = `${Math.floor(now.time_s).toLocaleString("en")} s${now.over ? ", over" : ""}`;
  play.textContent = now.paused ? "▶" : "❚❚";
  play.setAttribute("aria-label", now.paused ? "Play" : "Pause");
  play.disabled = now.over;
  if (document.activeElement !== speed) speed.value = String(now.speed);
}

let noteTimer = 0;

/** Show one line for a few seconds. */
function showNote(text, isWrong) {
  const note = document.getElementById("note");
  note.textContent = text;
  note.classList.toggle("wrong", isWrong);
  note.hidden = false;
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => {
    note.hidden = true;
  }, isWrong ? 8000 : 2500);
}
