// The page: unpack the runs, build the parts, and paint whenever something has changed.

class Page {
  constructor(runs) {
    this.runs = runs;
    this.frameS = Math.min(...runs.map((run) => run.frameS));
    this.player = new Player(Math.max(...runs.map((run) => run.endS)));
    this.camera = new Camera();
    const arenas = document.getElementById("arenas");
    this.panels = runs.map((run) => new Panel(arenas, run, this.camera, this));
    const curves = document.getElementById("curves");
    this.life = new LifeChart(curves, this.player, runs);
    this.charts = makeCharts(curves, this.player, runs);
    this.inspector = new Inspector(runs, this);
    this.legend = new Legend(runs, this);
    connectControls(this.player, this);
    this.describe();
    this.restyle();
    document.addEventListener("themed", () => this.restyle());
    addEventListener("resize", () => this.resize());
    addEventListener("hashchange", () => this.goToAddress());
    this.goToAddress();
    this.turn(performance.now()); // at once, for pictures that are taken as soon as the page is loaded
  }

  describe() {
    const { header } = this.runs[0];
    const { world } = header;
    const facts = [`${header.n_robots} robots`, `${header.n_objects} objects`, `${world.width_m} × ${world.height_m} m`,
      `seed ${header.seed}`];
    if (this.runs.length > 1) facts.unshift(header.scenario.replaceAll("_", " ")); // else the headline has it
    showFacts([...facts, ...this.disturbances()]);
  }

  /** What disturbs the runs, in words; those of one run alone begin with its name. */
  disturbances() {
    const [first, ...others] = this.runs.map((run) => run.header.disturbances);
    if (others.every((words) => words.join() === first.join())) return first;
    return this.runs.filter((run) => run.header.disturbances.length > 0)
      .map((run) => `${run.header.label}: ${run.header.disturbances.join(", ")}`);
  }

  repaint() {
    this.player.dirty = true;
  }

  restyle() {
    for (const panel of this.panels) panel.theme();
    this.legend.paint();
    this.resize();
  }

  resize() {
    const arenas = document.getElementById("arenas");
    const { width_m, height_m } = this.runs[0].header.world;
    const isNarrow = innerWidth <= 860;
    const height = isNarrow ? innerHeight * 0.62 * Math.max(1, this.runs.length / 2) : Math.max(300, innerHeight * 0.64);
    const captions = this.panels.map((panel) => panel.box.querySelector("figcaption").offsetHeight);
    const caption = Math.max(...captions) + 2;
    const grid = bestGrid(this.runs.length, width_m / height_m, arenas.clientWidth, height, 12, caption);
    arenas.style.gridTemplateColumns = `repeat(${grid.columns}, ${grid.width + 2}px)`;
    for (const panel of this.panels) panel.resize(grid.width, grid.height);
    for (const chart of [this.life, ...this.charts]) if (!chart.card.hidden) chart.resize();
    this.inspector.told = "";
    for (const chart of this.charts) chart.told = null;
    this.repaint();
  }

  turn(now) {
    this.player.tick(now);
    if (this.player.dirty) {
      this.player.dirty = false;
      this.paint();
    }
    requestAnimationFrame((next) => this.turn(next));
  }

  paint() {
    const { time, speed } = this.player;
    for (const run of this.runs) run.seek(time);
    for (const { view, run } of this.panels) {
      view.followed = focus.follows ? { x: run.x[focus.chosen], y: run.y[focus.chosen] } : null;
    }
    for (const panel of this.panels) panel.paint(speed);
    for (const chart of [this.life, ...this.charts]) if (!chart.card.hidden) chart.paint(time);
    showTime(this.player);
    this.inspector.update();
    this.keepAddress();
  }

  /** Look at a robot, or at none (-1). */
  choose(robot, panel) {
    focus.chosen = robot;
    focus.panel = panel;
    if (robot < 0) focus.follows = false;
    this.life.choose(robot);
    this.repaint();
  }

  /** Leave the camera where the panel is that a hand moves. */
  stopFollowing(view) {
    if (!focus.follows) return;
    focus.follows = false;
    const { x, y } = view.middle;
    Object.assign(this.camera, { x: x / view.world.width_m, y: y / view.world.height_m });
    for (const panel of this.panels) panel.view.followed = null;
  }

  follow(wanted) {
    if (focus.chosen < 0) return;
    focus.follows = wanted;
    if (wanted && this.camera.zoom < 2) this.camera.zoom = 3;
    this.repaint();
  }

  zoom(factor) {
    const { view } = this.panels[0];
    view.zoomAt(view.width / 2, view.height / 2, factor);
    this.repaint();
  }

  showWhole() {
    focus.follows = false;
    this.camera.reset();
    this.repaint();
  }

  /** Go where the address says, "#t=1200&robot=7": a moment in s, and a robot by its number. */
  goToAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    const time = asked.get("t") ? Number(asked.get("t")) : NaN;
    const robot = asked.get("robot") ? Number(asked.get("robot")) : NaN;
    if (Number.isFinite(time)) {
      this.player.pause();
      this.player.seek(time);
    }
    if (Number.isInteger(robot) && robot >= 0 && robot < this.runs[0].header.n_robots) this.choose(robot, this.panels[0]);
  }

  /** Make the address of a page that stands still a link to what it shows; later, because browsers count changes. */
  keepAddress() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      const { time, playing } = this.player;
      const words = [...(time > 0 ? [`t=${Math.round(10 * time) / 10}`] : []),
        ...(focus.chosen >= 0 ? [`robot=${focus.chosen}`] : [])];
      const address = words.length > 0 ? `#${words.join("&")}` : "";
      if (!playing && location.hash !== address) history.replaceState(null, "", address || location.href.split("#")[0]);
    }, 300);
  }

  showTip(panel, event) {
    showTip(panel, event);
    this.repaint();
  }

  hideTip() {
    document.getElementById("tip").hidden = true;
    this.repaint();
  }
}

async function start() {
  const loading = document.getElementById("loading");
  try {
    theme.start();
    const header = JSON.parse(document.getElementById("header").textContent);
    const texts = [...document.querySelectorAll("script.run")];
    const runs = [];
    for (const [index, about] of header.runs.entries()) {
      runs.push(new Run(about, await unpackRun(about, texts[index].textContent)));
      texts[index].remove(); // the text is not needed any more, and it is large
    }
    new Page(runs);
    loading.hidden = true;
  } catch (error) {
    loading.textContent = `This replay cannot be shown: ${error.message}. The file may be damaged, or the browser too old.`;
    throw error;
  }
}

start();
