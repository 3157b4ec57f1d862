// The cards beside the arena: numbers of now, the chosen robot, sliders.

/** Rows of numbers, as [name, text]. */
function numbersOf(swarm) {
  const { now } = swarm;
  const atWork = swarm.nRobots - swarm.having(ABSENT | REPAIR);
  const { counter, words } = swarm.header.performance;
  const rows = [
    [words, plainNumber(swarm.counted(counter))],
    ["deliveries per 1,000 s", plainNumber(now.per_1000_s)],
    ["time in interference", `${(100 * now.interference).toFixed(1)} %`],
    ["robots at work", `${atWork} of ${swarm.nRobots}`],
    ["carrying now", String(swarm.having(CARRYING))],
  ];
  return rows;
}

/** The chosen robot: what it does, and what can be done to it. Its buttons stay, so that they can be clicked. */
class RobotCard {
  constructor(page) {
    this.page = page;
    this.card = document.getElementById("robot");
    this.shown = -2;
  }

  show(swarm, robot) {
    if (robot !== this.shown) this.begin(robot);
    if (robot < 0) return;
    const wheels = swarm.now.robot?.row === robot ? [["wheels", swarm.now.robot.wheels]] : [];
    this.table.replaceChildren(tableOf([swarm], [...robotFacts(swarm, robot), ...wheels]));
    const state = swarm.status[robot];
    this.buttons.kill.disabled = Boolean(state & ABSENT);
    this.buttons.break.disabled = Boolean(state & (ABSENT | REPAIR));
    this.buttons.repair.disabled = Boolean(state & ABSENT) || !(state & REPAIR);
  }

  begin(robot) {
    this.shown = robot;
    if (robot < 0) {
      const hint = document.createElement("p");
      hint.className = "hint";
      hint.textContent = "Click a robot to see what it does, to kill, break or repair it.";
      this.card.replaceChildren(hint);
      return;
    }
    const row = document.createElement("div");
    row.className = "buttons";
    this.table = document.createElement("div");
    this.buttons = {};
    for (const [word, text] of [["kill", "kill"], ["break", "break"], ["repair", "repair"]]) {
      const button = document.createElement("button");
      button.textContent = text;
      button.dataset.do = word;
      button.onclick = () => this.page.tell({ do: word, robot });
      this.buttons[word] = button;
      row.append(button);
    }
    this.card.replaceChildren(heading(`robot ${robot}`), this.table, row);
  }
}

/** A slider with its value; `use` is called with the number while it moves. */
class Slider {
  constructor(parent, { name, title, most, step }, use) {
    this.label = document.createElement("label");
    this.label.className = "slider";
    this.output = document.createElement("output");
    this.input = document.createElement("input");
    Object.assign(this.input, { type: "range", min: "0", max: String(most), step: String(step), id: `level-${name}` });
    this.label.append(title, this.output, this.input);
    parent.append(this.label);
    this.input.oninput = () => {
      this.moved = performance.now();
      this.output.textContent = plainNumber(Number(this.input.value));
      use(Number(this.input.value));
    };
  }

  /** Show the level of the run, unless a hand has just moved the slider: its command may be under way. */
  show(level) {
    if (performance.now() - (this.moved ?? -1000) < 500) return;
    this.input.disabled = level === null;
    if (level !== null) this.input.value = String(level);
    this.output.textContent = level === null ? "a table" : plainNumber(level);
  }
}
