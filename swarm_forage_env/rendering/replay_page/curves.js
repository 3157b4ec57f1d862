// Charts under the arenas: curves of all runs over time, with a cursor; a click jumps there.

const CURVE_BINS = 50; // as many intervals as the study records in a run of the paper
const SHORTEST_BIN_S = 40; // less, and single deliveries are all that is to be seen
const SHARE_BINS = 160;
const LEFT_PX = 47;
const RIGHT_PX = 8;
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 4], [1, 2]];

/** A round number at least as large. */
function roundUp(value) {
  if (value <= 0) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((factor) => factor * power >= value * 0.9999) * power;
}

function plainNumber(value) {
  if (Math.abs(value) >= 1000) return Math.round(value).toLocaleString("en");
  return String(Number(value.toPrecision(3)));
}

/** Frames that bound equal parts of a run. */
function binEdges(run, bins) {
  const count = Math.max(1, Math.min(bins, run.nFrames - 1));
  return Array.from({ length: count + 1 }, (_, k) => Math.round((k * (run.nFrames - 1)) / count));
}

/** A value for each part of a run, at the time of its middle. */
function binned(run, valueOf) {
  const bins = Math.min(CURVE_BINS, Math.max(10, Math.round(run.endS / SHORTEST_BIN_S)));
  const edges = binEdges(run, bins);
  return edges.slice(1).map((end, k) => ({
    time: (run.timeOf(edges[k]) + run.timeOf(end)) / 2,
    value: valueOf(edges[k], end),
  }));
}

const measures = {
  rate: (run, counter) =>
    binned(run, (a, b) => {
      const seconds = run.timeOf(b) - run.timeOf(a);
      return seconds > 0 ? (1000 * (run.counted(counter, b) - run.counted(counter, a))) / seconds : 0;
    }),
  total: (run, counter) =>
    Array.from({ length: Math.min(400, run.nFrames) }, (_, k, count = Math.min(400, run.nFrames)) => {
      const frame = Math.round((k * (run.nFrames - 1)) / Math.max(1, count - 1));
      return { time: run.timeOf(frame), value: run.counted(counter, frame) };
    }),
  interference: (run) =>
    binned(run, (a, b) => {
      const active = run.counted("active", b) - run.counted("active", a);
      return active > 0 ? (100 * (run.counted("interfering", b) - run.counted("interfering", a))) / active : 0;
    }),
  signal: (run, name) => {
    const values = run.arrays[`signal_${name}`];
    const stride = Math.max(1, Math.floor(run.nFrames / 600));
    return Array.from(values, (value, frame) => ({ time: run.timeOf(frame), value })).filter(
      (_, frame) => frame % stride === 0,
    );
  },
};

/** Value of a curve at a time: that of the nearest sample. */
function valueAt(points, time) {
  let best = points[0];
  for (const point of points) if (Math.abs(point.time - time) < Math.abs(best.time - time)) best = point;
  return best ? best.value : 0;
}

/** A card with a heading, values at the cursor and a canvas; the still part of the picture is painted once. */
class Chart {
  constructor(parent, title, height, player) {
    this.player = player;
    this.height = height;
    this.card = document.createElement("div");
    this.card.className = "curve";
    this.card.innerHTML = `<header><h2></h2><div class="values"></div></header><canvas></canvas>`;
    this.heading = this.card.querySelector("h2");
    this.heading.textContent = title;
    this.values = this.card.querySelector(".values");
    this.canvas = this.card.querySelector("canvas");
    this.canvas.setAttribute("aria-label", title);
    this.still = document.createElement("canvas");
    parent.append(this.card);
    this.canvas.addEventListener("pointerdown", (event) => this.jump(event));
    this.canvas.addEventListener("pointermove", (event) => event.buttons && this.jump(event));
  }

  jump(event) {
    const { left } = this.canvas.getBoundingClientRect();
    this.player.seek(((event.clientX - left - LEFT_PX) / (this.width - LEFT_PX - RIGHT_PX)) * this.player.endS);
  }

  x(time) {
    return LEFT_PX + (time / this.player.endS) * (this.width - LEFT_PX - RIGHT_PX);
  }

  y(value) {
    return this.height - 18 - (value / this.top) * (this.height - 24);
  }

  resize() {
    this.width = Math.max(120, this.card.clientWidth - 24);
    this.pen = sizeCanvas(this.canvas, this.width, this.height);
    const pen = sizeCanvas(this.still, this.width, this.height);
    pen.clearRect(0, 0, this.width, this.height);
    this.paintStill(pen);
  }

  timeAxis(pen) {
    const step = roundUp(this.player.endS / (this.width < 500 ? 3.5 : 8));
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = theme.colours.faint;
    pen.textBaseline = "alphabetic";
    for (let time = 0; time <= this.player.endS * 1.0001; time += step) {
      const isLast = this.x(time) > this.width - 30;
      pen.textAlign = isLast ? "right" : time === 0 ? "left" : "center";
      pen.fillText(plainNumber(time) + (time === 0 ? " s" : ""), isLast ? this.width - 2 : this.x(time), this.height - 4);
    }
  }

  valueAxis(pen, unit = "") {
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    for (const share of [0, 0.5, 1]) {
      const y = Math.round(this.y(share * this.top)) + 0.5;
      pen.strokeStyle = theme.colours.grid;
      pen.beginPath();
      pen.moveTo(LEFT_PX, y);
      pen.lineTo(this.width - RIGHT_PX, y);
      pen.stroke();
      pen.fillStyle = theme.colours.faint;
      pen.fillText(plainNumber(share * this.top) + unit, LEFT_PX - 6, y);
    }
  }

  paint(time) {
    this.pen.clearRect(0, 0, this.width, this.height);
    this.pen.drawImage(this.still, 0, 0, this.width, this.height);
    this.pen.strokeStyle = theme.colours.text;
    this.pen.lineWidth = 1.2;
    this.pen.beginPath();
    this.pen.moveTo(this.x(time), 2);
    this.pen.lineTo(this.x(time), this.height - 16);
    this.pen.stroke();
    this.tell(time);
  }

  /** Show named values with their colours beside the title. */
  tellValues(entries) {
    const wanted = entries.map(([colour, text]) => `${colour}|${text}`).join();
    if (wanted === this.told) return;
    this.told = wanted;
    this.values.replaceChildren(
      ...entries.map(([colour, text]) => {
        const item = document.createElement("span");
        if (colour) item.append(swatch(colour));
        item.append(text);
        return item;
      }),
    );
  }
}

/** Lines, one per run. */
class LineChart extends Chart {
  constructor(parent, title, player, runs, series, unit = "") {
    super(parent, title, 92, player);
    this.runs = runs;
    this.unit = unit;
    this.use(series);
  }

  use(series) {
    this.lines = this.runs.map(series);
    const all = [...this.lines, ...(this.ghosts ?? [])].flat();
    this.top = roundUp(Math.max(0, ...all.map((point) => point.value)));
  }

  paintStill(pen) {
    this.valueAxis(pen, this.unit);
    this.timeAxis(pen);
    for (const points of this.ghosts ?? []) {
      pen.strokeStyle = theme.colours.faint;
      pen.lineWidth = 1;
      pen.beginPath();
      for (const { time, value } of points) if (time <= this.player.endS) pen.lineTo(this.x(time), this.y(value));
      pen.stroke();
    }
    this.lines.forEach((points, index) => {
      pen.strokeStyle = theme.ofRun(this.runs[index]);
      pen.lineWidth = 1.8;
      pen.lineJoin = "round";
      if (this.runs.length > 1) pen.setLineDash(DASHES[this.runs[index].look % DASHES.length]);
      pen.beginPath();
      for (const { time, value } of points) pen.lineTo(this.x(time), this.y(value));
      pen.stroke();
      pen.setLineDash([]);
    });
  }

  tell(time) {
    this.tellValues(
      this.lines.map((points, index) => [
        theme.ofRun(this.runs[index]),
        `${this.runs.length > 1 ? `${this.runs[index].header.label} ` : ""}${plainNumber(valueAt(points, time))}${this.unit}`,
      ]),
    );
  }
}

/** Shares of tasks in one run, one above the other. */
class ShareChart extends Chart {
  constructor(parent, player, run, title) {
    super(parent, title, 92, player);
    this.run = run;
    this.top = 100;
    this.edges = binEdges(run, SHARE_BINS);
    this.shares = this.edges.map((frame) => this.sharesAt(frame));
  }

  /** Part of the robots at work in each task, at a frame. */
  sharesAt(frame) {
    const counts = new Float64Array(8);
    let active = 0;
    for (let robot = 0; robot < this.run.nRobots; robot++) {
      const state = this.run.arrays.status[robot * this.run.nFrames + frame];
      if (state & (ABSENT | REPAIR)) continue;
      active++;
      counts[(state >> TASK_SHIFT) & 7]++;
    }
    return counts.map((count) => (active ? (100 * count) / active : 0));
  }

  paintStill(pen) {
    this.valueAxis(pen, " %");
    this.timeAxis(pen);
    const below = new Float64Array(this.edges.length);
    for (let task = 0; task < 8; task++) {
      pen.fillStyle = theme.colours[`task-${task}`];
      pen.beginPath();
      this.edges.forEach((frame, k) => pen.lineTo(this.x(this.run.timeOf(frame)), this.y(below[k])));
      for (let k = this.edges.length - 1; k >= 0; k--) {
        below[k] += this.shares[k][task];
        pen.lineTo(this.x(this.run.timeOf(this.edges[k])), this.y(below[k]));
      }
      pen.fill();
    }
  }

  tell() {
    const shares = this.sharesAt(this.run.frame);
    const named = [...shares].map((share, task) => [share, task]).filter(([share]) => share >= 0.5);
    this.tellValues(
      named.map(([share, task]) => [theme.colours[`task-${task}`], `${this.run.header.tasks[task]} ${Math.round(share)} %`]),
    );
  }
}

/** The life of the chosen robot in every run: carrying, in interference, away. */
class LifeChart extends Chart {
  constructor(parent, player, runs) {
    super(parent, "", 20 + 16 * runs.length, player);
    this.runs = runs;
    this.choose(-1);
  }

  choose(robot) {
    this.robot = robot;
    this.card.hidden = robot < 0;
    this.heading.textContent = `robot ${robot}: when it carried, avoided, was away`;
    if (robot >= 0) this.resize();
  }

  paintStill(pen) {
    if (this.robot < 0) return;
    this.timeAxis(pen);
    this.runs.forEach((run, row) => {
      const top = 2 + 16 * row;
      if (this.runs.length > 1) {
        pen.fillStyle = theme.ofRun(run);
        pen.fillRect(LEFT_PX - 12, top + 3, 6, 6);
      }
      for (let x = LEFT_PX; x < this.width - RIGHT_PX; x++) {
        pen.fillStyle = this.colourAt(run, x);
        pen.fillRect(x, top, 1, 12);
      }
    });
  }

  colourAt(run, x) {
    const share = (x - LEFT_PX) / (this.width - LEFT_PX - RIGHT_PX);
    const { frame } = run.frameAt(share * this.player.endS);
    const state = run.arrays.status[this.robot * run.nFrames + frame];
    if (share * this.player.endS > run.endS || state & ABSENT) return theme.colours.panel;
    if (state & REPAIR) return theme.colours.repair;
    if (state & INTERFERING) return theme.colours.interference;
    return state & CARRYING ? theme.colours.carrying : theme.colours.grid;
  }

  tell() {
    this.tellValues([
      [theme.colours.carrying, "carrying"],
      [theme.colours.interference, "in interference"],
      [theme.colours.repair, "in repair"],
    ]);
  }
}

function swatch(colour) {
  const mark = document.createElement("i");
  mark.className = "swatch";
  mark.style.background = colour;
  return mark;
}

/** All charts that these runs have something for. */
function makeCharts(parent, player, runs) {
  const charts = [];
  const { counter, words } = runs[0].header.performance;
  const main = new LineChart(parent, `${words} per 1,000 s`, player, runs, (run) => measures.rate(run, counter));
  ratesOrTotals(main, counter, words);
  charts.push(main);
  charts.push(new LineChart(parent, "robots in interference", player, runs, measures.interference, " %"));
  for (const run of runs.filter((one) => one.header.has_tasks)) {
    const title = runs.length > 1 ? `tasks, ${run.header.label}` : "tasks";
    charts.push(new ShareChart(parent, player, run, title));
  }
  for (const { name, title, unit } of signalsOf(runs)) {
    const having = runs.filter((run) => `signal_${name}` in run.arrays);
    charts.push(new LineChart(parent, title, player, having.slice(0, 1), (run) => measures.signal(run, name), unit));
  }
  return charts;
}

/** A button that switches a chart between rates and totals. */
function ratesOrTotals(chart, counter, words) {
  const button = document.createElement("button");
  const turn = (measure) => {
    const isRate = measure === "rate";
    chart.use((run) => measures[measure](run, counter));
    chart.heading.firstChild.textContent = isRate ? `${words} per 1,000 s` : `${words} in all`;
    button.textContent = isRate ? "in all" : "per 1,000 s";
    button.onclick = () => turn(isRate ? "total" : "rate");
    if (chart.width) chart.resize();
    chart.player.dirty = true;
  };
  turn("rate");
  chart.heading.append(button);
}

function signalsOf(runs) {
  const found = new Map();
  for (const run of runs) for (const signal of run.header.signals) found.set(signal.name, signal);
  return [...found.values()];
}
