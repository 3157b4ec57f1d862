// What the signs mean, and what is shown.

/** Paints one robot in the middle of a small canvas. */
const stamp = Object.assign(new Painter({ x: [0], y: [0], turn: [0.5] }, { px: () => 11, py: () => 11 }), { radius: 5 });

/** Paint one sign of the legend. */
const signs = {
  empty: (pen) => stamp.bodies(pen, [0], theme.colours.empty),
  carrying: (pen) => {
    stamp.bodies(pen, [0], theme.colours.carrying);
    stamp.cargo(pen, [0]);
  },
  "in interference": (pen) => {
    stamp.bodies(pen, [0], theme.colours.empty);
    stamp.rings(pen, [0], 8.5, 2, theme.colours.interference);
  },
  "in repair": (pen) => stamp.rings(pen, [0], 4.5, 2.6, theme.colours.repair),
  dead: (pen) => stamp.crosses(pen, [0]),
  delivered: (pen) => stamp.rings(pen, [0], 7, 2, theme.colours.nest),
  object: (pen) => {
    pen.fillStyle = theme.colours.object;
    pen.fillRect(8, 8, 6, 6);
  },
  nest: (pen) => areaSign(pen, theme.colours.nest, 0.3),
  obstacle: (pen) => areaSign(pen, theme.colours.wall, 1, false),
  source: (pen) => areaSign(pen, theme.colours.source, 0.25, false),
  cache: (pen) => areaSign(pen, theme.colours.cache, 0.3),
};

function areaSign(pen, colour, opacity, framed = true) {
  pen.fillStyle = pen.strokeStyle = colour;
  pen.globalAlpha = opacity;
  pen.fillRect(3, 3, 16, 16);
  pen.globalAlpha = 1;
  pen.lineWidth = 1.5;
  if (framed) pen.strokeRect(3, 3, 16, 16);
}

class Legend {
  constructor(runs, page) {
    this.runs = runs;
    this.page = page;
    this.card = document.getElementById("legend");
    this.list = document.createElement("ul");
    this.card.append(this.list, this.choices());
  }

  /** A list of [name, painter] of the signs that occur in these runs. */
  entries() {
    const anyRun = (test) => this.runs.some(test);
    this.hasRepair ??= anyRun((run) => run.arrays.status.some((state) => state & REPAIR));
    this.hasDead ??= anyRun((run) => run.x.some((_, robot) => run.isDead(robot, run.nFrames - 1)));
    const byTask = shown.colour === "task";
    const names = byTask ? [] : ["empty", "carrying"];
    names.push("in interference");
    if (this.hasRepair) names.push("in repair");
    if (this.hasDead) names.push("dead");
    names.push("delivered", "object", "nest");
    if (anyRun((run) => run.header.world.obstacles_m.length > 0)) names.push("obstacle");
    if (anyRun((run) => run.header.world.sources_m.length > 0)) names.push("source");
    if (anyRun((run) => run.header.world.caches !== "none")) names.push("cache");
    const tasks = byTask ? this.tasksInUse().map((task) => [this.runs[0].header.tasks[task], (pen) => stamp.bodies(pen, [0], theme.colours[`task-${task}`])]) : [];
    return [...tasks, ...names.map((name) => [name, signs[name]])];
  }

  tasksInUse() {
    const used = new Set();
    for (const run of this.runs) {
      if (!run.header.has_tasks) used.add(0);
      else for (const state of run.arrays.status) used.add((state >> TASK_SHIFT) & 7);
    }
    return [...used].sort((a, b) => a - b);
  }

  paint() {
    this.list.replaceChildren(
      ...this.entries().map(([name, sign]) => {
        const item = document.createElement("li");
        const canvas = document.createElement("canvas");
        sign(sizeCanvas(canvas, 22, 22));
        item.append(canvas, name);
        return item;
      }),
    );
  }

  choices() {
    const row = document.createElement("div");
    row.className = "choices";
    row.append(this.choice("trails", [[0, "none"], [30, "30 s"], [120, "2 min"], [600, "10 min"]], shown.trails, (value) => {
      shown.trails = Number(value);
    }));
    if (this.runs.some((run) => run.header.has_tasks)) {
      row.append(this.choice("colour by", [["cargo", "cargo"], ["task", "task"]], shown.colour, (value) => {
        shown.colour = value;
        this.paint();
      }));
    }
    return row;
  }

  choice(name, options, current, use) {
    const label = document.createElement("label");
    const select = document.createElement("select");
    for (const [value, text] of options) select.add(new Option(text, value, value === current, value === current));
    select.onchange = () => {
      use(select.value);
      this.page.repaint();
    };
    label.append(name, select);
    return label;
  }
}
