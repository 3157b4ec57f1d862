// The page to play with: ask for frames, paint them, and send what the reader does.

const FRAME_MS = 33; // our choice: thirty frames a second look smooth, and leave the processor to the run
const STILL_MS = 250; // while nothing moves
const REFUSED_MS = 1000; // after a frame that was refused

class PlayPage {
  constructor() {
    this.camera = new Camera();
    this.serial = 0; // the number of no run
    this.drawsWalls = false;
    this.robotCard = new RobotCard(this);
    this.waiting = new Map(); // levels that are to be sent
    connectButtons(this);
    document.addEventListener("themed", () => this.restyle());
    addEventListener("resize", () => this.resize());
    this.go();
  }

  /** Look again and again. What is refused is told, and the reader can still start another run. */
  async go() {
    for (let isLost = false; !isLost; ) {
      const began = performance.now();
      let pause = FRAME_MS;
      try {
        await this.look();
        if (this.swarm.now.paused || this.swarm.now.over) pause = STILL_MS;
      } catch (error) {
        const loading = document.getElementById("loading");
        loading.hidden = false;
        loading.textContent = error.message;
        pause = REFUSED_MS;
        isLost = error instanceof LostError;
        if (!isLost) console.error(error); // it may be a fault of this page
      }
      await this.sleep(Math.max(0, pause - (performance.now() - began)));
    }
  }

  /** Wait, but no longer than until a command is done; a page that nobody sees waits, and with it the run. */
  sleep(ms) {
    return new Promise((done) => {
      this.wake = done;
      setTimeout(() => requestAnimationFrame(done), ms);
    });
  }

  async look() {
    const words = { run: this.serial };
    if (focus.chosen >= 0) words.robot = focus.chosen;
    const frame = await link.ask("frame", words);
    if (frame.about) this.begin(frame.about, frame.run);
    this.swarm.take(frame);
    this.show();
  }

  /** Build what depends on the run. */
  begin(about, serial) {
    const isOther = !this.about || about.header.n_robots <= focus.chosen;
    if (isOther) this.choose(-1, null);
    this.serial = serial;
    this.about = about;
    this.swarm = new LiveSwarm(about.header);
    const ghosts = [this.rate?.lines, this.interference?.lines];
    for (const id of ["arenas", "curves"]) {
      const place = document.getElementById(id);
      place.style.minHeight = `${place.offsetHeight}px`; // else what is below jumps
      place.replaceChildren();
    }
    this.panel = new PlayPanel(document.getElementById("arenas"), this.swarm, this.camera, this);
    this.clock = { endS: 1, seek() {} };
    const chart = (title, unit) =>
      new LineChart(document.getElementById("curves"), title, this.clock, [this.swarm], () => [], unit);
    this.rate = chart("deliveries per 1,000 s", "");
    this.interference = chart("share of time in interference", " %");
    [this.rate.ghosts, this.interference.ghosts] = ghosts; // the run before, to compare with
    const legend = document.getElementById("legend");
    legend.replaceChildren();
    this.legend = new Legend([this.swarm], this);
    Object.assign(this.legend, { hasRepair: true, hasDead: true, tasksInUse: () => [1, 2, 3, 4, 5, 6, 7] });
    showSetting(this, about);
    this.fresh = true;
    this.told = "";
  }

  show() {
    const { now } = this.swarm;
    if (this.fresh) this.restyle();
    this.fresh = false;
    document.getElementById("loading").hidden = true;
    this.repaint();
    showControls(now);
    document.getElementById("score").replaceChildren(heading("now"), tableOf([this.swarm], numbersOf(this.swarm)));
    for (const { name } of this.about.sliders) this.sliders[name].show(now.levels[name]);
    document.getElementById("changes").textContent = now.changes && `changed by hand: ${now.changes}`;
    this.robotCard.show(this.swarm, focus.chosen);
    this.showCurves(now);
  }

  showCurves({ curve, time_s: time }) {
    const told = curve.time_s.join();
    if (told !== this.told) {
      this.told = told;
      this.clock.endS = Math.max(time, 1);
      const points = (values, factor) => curve.time_s.map((at, k) => ({ time: at, value: factor * values[k] }));
      this.rate.use(() => points(curve.per_1000_s, 1));
      this.interference.use(() => points(curve.interference, 100));
      for (const chart of [this.rate, this.interference]) chart.resize();
    }
    for (const chart of [this.rate, this.interference]) chart.paint(time);
  }

  repaint() {
    if (this.swarm?.now && this.panel.pen) this.panel.paint(this.swarm.now.speed);
  }

  restyle() {
    if (!this.swarm?.now) return;
    this.panel.theme();
    this.legend.paint();
    this.resize();
  }

  resize() {
    if (!this.swarm?.now) return;
    const arenas = document.getElementById("arenas");
    const { width_m, height_m } = this.swarm.header.world;
    const height = innerWidth <= 860 ? innerHeight * 0.5 : Math.max(300, innerHeight * 0.62);
    arenas.style.gridTemplateColumns = "100%"; // names that wrap in a narrow panel would make the arena smaller
    const caption = this.panel.box.querySelector("figcaption").offsetHeight + 2;
    const grid = bestGrid(1, width_m / height_m, arenas.clientWidth, height, 12, caption);
    arenas.style.gridTemplateColumns = `${grid.width + 2}px`;
    this.panel.resize(grid.width, grid.height);
    for (const id of ["arenas", "curves"]) document.getElementById(id).style.minHeight = "";
    for (const chart of [this.rate, this.interference]) {
      chart.told = null;
      chart.resize();
      chart.paint(this.swarm.time);
    }
    this.repaint();
  }

  /** Look at a robot, or at none (-1). */
  choose(robot, panel) {
    focus.chosen = robot;
    focus.panel = panel;
    if (this.swarm) this.robotCard.show(this.swarm, robot);
    this.wake?.();
    this.repaint();
  }

  showWhole() {
    this.camera.reset();
    this.repaint();
  }

  showTip(panel, event) {
    if (!this.drawsWalls) showTip(panel, event);
    this.repaint();
  }

  hideTip() {
    document.getElementById("tip").hidden = true;
    this.repaint();
  }

  /** Send a command, and tell what it has done. */
  async tell(command) {
    try {
      const { done } = await link.ask("command", command);
      if (done) showNote(done, false);
    } catch (error) {
      showNote(error.message, true);
    }
    this.wake?.();
  }

  /** Send the level of a slider; while one is under way, only the last of the later ones. */
  async setLevel(name, value) {
    const isUnderWay = this.waiting.has(name);
    this.waiting.set(name, value);
    if (isUnderWay) return;
    for (let sent; sent !== this.waiting.get(name); ) {
      sent = this.waiting.get(name);
      await this.tell({ do: "level", name, value: sent });
    }
    this.waiting.delete(name);
  }

  removeWallAt(x, y) {
    const walls = this.swarm.header.world.obstacles_m;
    const index = walls.findLastIndex(([left, low, right, high]) => left <= x && x <= right && low <= y && y <= high);
    if (index < 0) showNote("Drag to draw a wall; click on a wall to remove it.", false);
    else this.tell({ do: "remove_wall", index });
  }

  drawWalls(wanted) {
    this.drawsWalls = wanted;
    document.getElementById("wall").setAttribute("aria-pressed", String(wanted));
    this.hideTip(); // it would cover a wall that is drawn
  }

  async save() {
    try {
      const { name, page } = await link.ask("replay", null);
      const place = URL.createObjectURL(new Blob([page], { type: "text/html" }));
      const anchor = Object.assign(document.createElement("a"), { href: place, download: name });
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(place), 10000);
      showNote(`saved as ${name}`, false);
    } catch (error) {
      showNote(error.message, true);
    }
  }
}

theme.start();
new PlayPage();
