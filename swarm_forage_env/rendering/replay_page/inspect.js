// What is told in words: counts of the runs, the state of a robot, the tip at the pointer.

/** Rows of what one robot is doing, as [name, text]. */
function robotFacts(run, robot) {
  const state = run.status[robot];
  if (state & ABSENT) return [["state", run.isDead(robot) ? "dead" : "not yet born"]];
  const facts = [["state", stateWords(state)]];
  if (run.header.has_tasks) facts.push(["task", run.header.tasks[run.task(robot)]]);
  const activity = run.activity(robot);
  if (activity) facts.push(["activity", activity]);
  const places = run.places(robot);
  if (places) facts.push(["remembers", places.length === 1 ? "1 thing" : `${places.length} things`]);
  const cargo = state & CARRYING ? run.cargo(robot) : -1;
  facts.push(["cargo", cargo >= 0 ? `object ${cargo}` : "none"]);
  facts.push(["place", `${run.x[robot].toFixed(1)}, ${run.y[robot].toFixed(1)} m`]);
  return facts;
}

function stateWords(state) {
  if (state & REPAIR) return "in repair";
  const words = [];
  if (state & INTERFERING) words.push("in interference");
  if (state & HANDLING) words.push("waiting for its gripper");
  if (!words.length) words.push(state & CARRYING ? "carrying" : "empty");
  return words.join(", ");
}

const UPRIGHT_RUNS = 3; // from so many on, whole names have no room above their columns and stand upright

/** A table with a column per run; each row is [name, text of run 0, text of run 1, ...]. */
function tableOf(runs, rows) {
  const table = document.createElement("table");
  if (runs.length > 1) {
    const names = table.createTHead().insertRow();
    names.append(document.createElement("th"));
    for (const run of runs) {
      const name = document.createElement("span");
      name.style.color = theme.ofRun(run);
      name.append(...breakable(run.header.label));
      const head = document.createElement("th");
      head.append(name);
      names.append(head);
    }
    table.classList.toggle("narrow", runs.length >= UPRIGHT_RUNS);
  }
  const body = table.createTBody();
  for (const [name, ...texts] of rows) {
    const row = body.insertRow();
    const head = document.createElement("th");
    head.textContent = name;
    row.append(head);
    for (const text of texts) row.insertCell().textContent = text;
  }
  return table;
}

class Inspector {
  constructor(runs, page) {
    this.runs = runs;
    this.page = page;
    this.score = document.getElementById("score");
    this.robot = document.getElementById("robot");
    this.told = "";
  }

  /** Write what has changed; tables are small, so they are made anew. */
  update() {
    const frames = this.runs.map((run) => run.frame).join();
    const now = `${frames} ${focus.chosen} ${focus.follows} ${document.documentElement.dataset.theme}`;
    if (now === this.told) return;
    this.told = now;
    this.score.replaceChildren(heading("now"), tableOf(this.runs, this.scoreRows()));
    this.updateRobot();
  }

  scoreRows() {
    const column = (text) => this.runs.map(text);
    const share = (flag) => (run) => {
      let [active, with_] = [0, 0];
      for (const state of run.status) {
        if (state & (ABSENT | REPAIR)) continue;
        active++;
        if (state & flag) with_++;
      }
      return active ? `${Math.round((100 * with_) / active)} %` : "–";
    };
    const rows = [
      [this.runs[0].header.performance.words, ...column((run) => plainNumber(run.counted(run.header.performance.counter)))],
      ["carrying", ...column(share(CARRYING))],
      ["in interference", ...column(share(INTERFERING))],
      ["at work", ...column((run) => String(run.status.reduce((sum, s) => sum + !(s & (ABSENT | REPAIR)), 0)))],
    ];
    if (this.runs.some((run) => run.header.world.caches !== "none")) {
      rows.push(["caches", ...column((run) => (run.header.world.caches === "none" ? "–" : String(countCaches(run))))]);
    }
    for (const { name, title, unit } of signalsOf(this.runs)) {
      rows.push([title, ...column((run) => signalNow(run, name, unit))]);
    }
    return rows;
  }

  updateRobot() {
    if (focus.chosen < 0) {
      const hint = document.createElement("p");
      hint.className = "hint";
      const way = matchMedia("(pointer: coarse)").matches ? "Tap" : "Click";
      hint.textContent = `${way} a robot to see what it is doing, and to follow it.`;
      this.robot.replaceChildren(hint);
      return;
    }
    const title = heading(`robot ${focus.chosen}`);
    const follow = document.createElement("button");
    follow.textContent = focus.follows ? "following" : "follow";
    follow.setAttribute("aria-pressed", String(focus.follows));
    follow.onclick = () => this.page.follow(!focus.follows);
    title.append(follow);
    this.robot.replaceChildren(title, ...this.robotWords());
  }

  /** The state of the chosen robot: a table for one run, a paragraph each for several. */
  robotWords() {
    if (this.runs.length === 1) return [tableOf(this.runs, robotFacts(this.runs[0], focus.chosen))];
    return this.runs.map((run) => {
      const told = document.createElement("p");
      told.className = "told";
      const name = document.createElement("b");
      name.textContent = run.header.label;
      const words = robotFacts(run, focus.chosen).map(([key, text]) =>
        ["task", "state", "activity"].includes(key) ? text : `${key} ${text}`,
      );
      told.append(swatch(theme.ofRun(run)), name, words.join(" · "));
      return told;
    });
  }
}

/** Tell of the robot under the pointer, beside it. */
function showTip(panel, event) {
  const tip = document.getElementById("tip");
  tip.hidden = focus.hovered < 0;
  if (tip.hidden) return;
  const lines = [`robot ${focus.hovered}`, ...robotFacts(panel.run, focus.hovered).map((fact) => fact.join(": "))];
  tip.replaceChildren(
    ...lines.map((text, k) => Object.assign(document.createElement(k ? "span" : "b"), { textContent: text })),
  );
  const { offsetWidth, offsetHeight } = tip;
  const left = event.clientX + 16 + offsetWidth > innerWidth ? event.clientX - offsetWidth - 12 : event.clientX + 16;
  tip.style.left = `${Math.max(4, left)}px`;
  tip.style.top = `${Math.max(4, Math.min(event.clientY + 14, innerHeight - offsetHeight - 6))}px`;
}

function countCaches(run) {
  const values = run.caches.at(run.frame);
  let count = 0;
  for (let slot = 0; slot < run.header.n_cache_slots; slot++) count += values[3 * slot] > 0;
  return count;
}

function signalNow(run, name, unit) {
  const values = run.arrays[`signal_${name}`];
  return values ? plainNumber(values[run.frame]) + unit : "–";
}

function heading(text) {
  const title = document.createElement("h2");
  title.append(text);
  return title;
}
