// One picture of a run: floor, trails, caches, objects, robots. Things of one colour are one path, so that hundreds of
// robots cost a few strokes.

const FLASH_S = 0.7; // seconds of the reader for which a delivery is shown
const TRAIL_STEPS = 24;
const MOST_TRAILS = 2000; // trails of more robots would hide the floor
const DETAILED_PX = 2.2; // robots below this radius are plain discs

/** What is drawn, as chosen in the legend. */
const shown = { trails: 30, colour: "cargo", objects: true };

function disc(pen, x, y, radius) {
  pen.moveTo(x + radius, y);
  pen.arc(x, y, radius, 0, 2 * Math.PI);
}

class Painter {
  constructor(run, view) {
    this.run = run;
    this.view = view;
  }

  paint(pen, { chosen, hovered, speed }) {
    const { view, run } = this;
    view.settle();
    pen.clearRect(0, 0, view.width, view.height);
    this.radius = view.robotPx(run.nRobots);
    this.floor(pen);
    if (shown.trails > 0) this.trails(pen, chosen);
    this.caches(pen);
    if (shown.objects) this.objects(pen);
    this.flashes(pen, speed);
    this.robots(pen);
    this.counts(pen);
    for (const robot of new Set([hovered, chosen])) if (robot >= 0) this.halo(pen, robot, robot === chosen);
  }

  box(pen, [left, bottom, right, top]) {
    const { view } = this;
    pen.rect(view.px(left), view.py(top), (right - left) * view.scale, (top - bottom) * view.scale);
  }

  fillBox(pen, box, colour, opacity) {
    pen.globalAlpha = opacity;
    pen.fillStyle = colour;
    pen.beginPath();
    this.box(pen, box);
    pen.fill();
    pen.globalAlpha = 1;
  }

  floor(pen) {
    const { world } = this.run.header;
    const colour = theme.colours;
    this.fillBox(pen, [-world.wall_m, -world.wall_m, world.width_m + world.wall_m, world.height_m + world.wall_m],
      colour.wall, 1);
    this.fillBox(pen, world.interior_m, colour.floor, 1);
    for (const source of world.sources_m) this.fillBox(pen, source, colour.source, 0.1);
    pen.strokeStyle = colour.nest;
    pen.lineWidth = 1.5;
    for (const nest of world.nest_boxes_m) {
      this.fillBox(pen, nest, colour.nest, 0.22);
      pen.beginPath();
      this.box(pen, nest);
      pen.stroke();
    }
    for (const box of world.obstacles_m) this.fillBox(pen, box, colour.wall, 1);
    pen.fillStyle = colour.light;
    pen.beginPath();
    for (const [x, y] of world.lights_m) disc(pen, this.view.px(x), this.view.py(y), 3);
    pen.fill();
  }

  /** Where robots were in the last seconds, fading; the trail of the chosen robot stands out. */
  trails(pen, chosen) {
    const { nRobots } = this.run;
    if (nRobots <= MOST_TRAILS) this.trailsOf(pen, [...Array(nRobots).keys()], Math.max(0.7, 0.45 * this.radius), 0.5);
    if (chosen >= 0) this.trailsOf(pen, [chosen], Math.max(1.8, 0.7 * this.radius), 1);
  }

  trailsOf(pen, robots, width, strength) {
    const { run } = this;
    const steps = Math.min(TRAIL_STEPS, Math.ceil(shown.trails / run.frameS));
    const stride = Math.max(1, Math.round(shown.trails / run.frameS / steps));
    pen.lineCap = "butt"; // round ends would overlap and look like beads
    pen.lineWidth = width;
    for (const [loaded, colour] of [[0, theme.colours.empty], [CARRYING, theme.colours.carrying]]) {
      pen.strokeStyle = colour;
      for (let age = steps; age > 0; age--) {
        const from = run.frame - age * stride;
        if (from < 0) continue;
        pen.globalAlpha = strength * (1 - age / (steps + 1));
        pen.beginPath();
        for (const robot of robots) this.trailPiece(pen, robot, from, from + stride, loaded);
        pen.stroke();
      }
      pen.globalAlpha = strength;
      pen.beginPath();
      for (const robot of robots) this.lastPiece(pen, robot, loaded);
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  trailPiece(pen, robot, from, to, loaded) {
    const { run, view } = this;
    const state = run.arrays.status[robot * run.nFrames + from];
    if (state & ABSENT || (state & CARRYING) !== loaded) return;
    const step = run.header.position_step_m;
    const { position } = run.arrays;
    const start = 2 * robot * run.nFrames + from;
    const end = start + to - from;
    if (position[start] === position[end] && position[start + run.nFrames] === position[end + run.nFrames]) return;
    pen.moveTo(view.px(step * position[start]), view.py(step * position[start + run.nFrames]));
    pen.lineTo(view.px(step * position[end]), view.py(step * position[end + run.nFrames]));
  }

  /** From the last frame to where the robot is now. */
  lastPiece(pen, robot, loaded) {
    const { run, view } = this;
    if (run.status[robot] & ABSENT || (run.status[robot] & CARRYING) !== loaded) return;
    const step = run.header.position_step_m;
    const at = 2 * robot * run.nFrames + run.frame;
    pen.moveTo(view.px(step * run.arrays.position[at]), view.py(step * run.arrays.position[at + run.nFrames]));
    pen.lineTo(view.px(run.x[robot]), view.py(run.y[robot]));
  }

  /** Caches that have objects: pixels of the middle and of a side, and how many objects. */
  *cachesNow() {
    const { run, view } = this;
    const { cell_m, cache_side_m, caches } = run.header.world;
    if (caches === "none") return;
    const values = run.caches.at(run.frame);
    const side = Math.max(cache_side_m * view.scale, 10);
    for (let slot = 0; slot < run.header.n_cache_slots; slot++) {
      const [count, column, row] = values.slice(3 * slot, 3 * slot + 3);
      if (count > 0) yield [view.px((column + 0.5) * cell_m), view.py((row + 0.5) * cell_m), side, count];
    }
  }

  caches(pen) {
    pen.fillStyle = pen.strokeStyle = theme.colours.cache;
    pen.lineWidth = 1.5;
    for (const [x, y, side] of this.cachesNow()) {
      pen.globalAlpha = 0.22;
      pen.fillRect(x - side / 2, y - side / 2, side, side);
      pen.globalAlpha = 1;
      pen.strokeRect(x - side / 2, y - side / 2, side, side);
    }
  }

  /** How many objects caches have, above the robots that stand in them. */
  counts(pen) {
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = 4;
    pen.strokeStyle = theme.colours.floor;
    pen.fillStyle = theme.colours.text;
    for (const [x, y, side, count] of this.cachesNow()) {
      pen.font = `600 ${Math.max(10, Math.min(22, 0.4 * side))}px system-ui, sans-serif`;
      pen.strokeText(String(count), x, y);
      pen.fillText(String(count), x, y);
    }
  }

  objects(pen) {
    const { run, view } = this;
    const { cell_m } = run.header.world;
    const values = run.objects.at(run.frame);
    const side = view.objectPx(run.header.n_objects);
    pen.fillStyle = theme.colours.object;
    for (let row = 0; row < run.header.n_objects; row++) {
      if (values[3 * row] !== FREE) continue;
      const x = view.px((values[3 * row + 1] + 0.5) * cell_m);
      const y = view.py((values[3 * row + 2] + 0.5) * cell_m);
      pen.fillRect(x - side / 2, y - side / 2, side, side);
    }
  }

  /** A ring grows where an object has just been delivered. */
  flashes(pen, speed) {
    const { run, view } = this;
    const { times, x, y } = run.deliveries;
    const lasts = Math.max(2 * run.frameS, FLASH_S * speed);
    const first = countUpTo(times, run.time - lasts);
    const end = countUpTo(times, run.time);
    pen.strokeStyle = theme.colours.nest;
    pen.lineWidth = 2;
    for (let i = Math.max(first, end - 200); i < end; i++) {
      const age = (run.time - times[i]) / lasts;
      pen.globalAlpha = 0.9 * (1 - age);
      pen.beginPath();
      disc(pen, view.px(x[i]), view.py(y[i]), this.radius * (1.4 + 3 * age));
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  colourOf(robot) {
    const state = this.run.status[robot];
    if (shown.colour === "task" && this.run.header.has_tasks) return theme.colours[`task-${this.run.task(robot)}`];
    return state & CARRYING ? theme.colours.carrying : theme.colours.empty;
  }

  robots(pen) {
    const { run } = this;
    const groups = new Map();
    const [carrying, interfering, repair, gone] = [[], [], [], []];
    for (let robot = 0; robot < run.nRobots; robot++) {
      const state = run.status[robot];
      if (state & ABSENT) {
        if (run.isDead(robot)) gone.push(robot);
        continue;
      }
      if (state & CARRYING) carrying.push(robot);
      if (state & REPAIR) {
        repair.push(robot);
        continue;
      }
      if (state & INTERFERING) interfering.push(robot);
      const colour = this.colourOf(robot);
      if (!groups.has(colour)) groups.set(colour, []);
      groups.get(colour).push(robot);
    }
    this.crosses(pen, gone);
    this.rings(pen, repair, 0.8 * this.radius, 0.45 * this.radius, theme.colours.repair);
    for (const [colour, rows] of groups) this.bodies(pen, rows, colour);
    this.cargo(pen, carrying);
    this.rings(pen, interfering, 1.5 * this.radius + 0.5, Math.max(1.1, 0.34 * this.radius),
      theme.colours.interference);
  }

  bodies(pen, rows, colour) {
    const { run, view, radius } = this;
    const detailed = radius >= DETAILED_PX;
    pen.fillStyle = colour;
    pen.beginPath();
    for (const robot of rows) disc(pen, view.px(run.x[robot]), view.py(run.y[robot]), radius);
    pen.fill();
    if (!detailed) return;
    pen.lineWidth = Math.max(0.6, 0.12 * radius);
    pen.strokeStyle = theme.colours.floor; // a rim separates robots that touch
    pen.beginPath();
    for (const robot of rows) disc(pen, view.px(run.x[robot]), view.py(run.y[robot]), radius);
    pen.stroke();
    pen.lineWidth = Math.max(1, 0.4 * radius);
    pen.strokeStyle = colour;
    pen.beginPath();
    for (const robot of rows) {
      const [x, y] = [view.px(run.x[robot]), view.py(run.y[robot])];
      const [ahead, aside] = [Math.cos(run.turn[robot]), -Math.sin(run.turn[robot])];
      pen.moveTo(x + 0.7 * radius * ahead, y + 0.7 * radius * aside);
      pen.lineTo(x + 2.0 * radius * ahead, y + 2.0 * radius * aside);
    }
    pen.stroke();
  }

  cargo(pen, rows) {
    const { run, view } = this;
    const side = 0.85 * this.radius;
    if (side < 1.5) return;
    pen.fillStyle = theme.colours.floor;
    for (const robot of rows) {
      pen.fillRect(view.px(run.x[robot]) - side / 2, view.py(run.y[robot]) - side / 2, side, side);
    }
  }

  rings(pen, rows, radius, width, colour) {
    const { run, view } = this;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (const robot of rows) disc(pen, view.px(run.x[robot]), view.py(run.y[robot]), radius);
    pen.stroke();
  }

  /** Where robots died. */
  crosses(pen, rows) {
    const { run, view } = this;
    const half = 0.8 * this.radius;
    pen.strokeStyle = theme.colours.repair;
    pen.lineWidth = Math.max(1, 0.35 * this.radius);
    pen.globalAlpha = 0.7;
    pen.beginPath();
    for (const robot of rows) {
      const [x, y] = [view.px(run.x[robot]), view.py(run.y[robot])];
      pen.moveTo(x - half, y - half);
      pen.lineTo(x + half, y + half);
      pen.moveTo(x - half, y + half);
      pen.lineTo(x + half, y - half);
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  halo(pen, robot, chosen) {
    const { run, view } = this;
    const [x, y] = [view.px(run.x[robot]), view.py(run.y[robot])];
    pen.strokeStyle = theme.colours.text;
    pen.lineWidth = chosen ? 2 : 1.2;
    pen.beginPath();
    disc(pen, x, y, Math.max(9, 2.6 * this.radius));
    pen.stroke();
    this.memory(pen, robot);
    if (!chosen) return;
    pen.font = "600 12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    pen.lineWidth = 3;
    pen.strokeStyle = theme.colours.floor;
    pen.fillStyle = theme.colours.text;
    const [left, bottom] = [x + Math.max(9, 2.6 * this.radius) + 2, y - 5];
    pen.strokeText(String(robot), left, bottom);
    pen.fillText(String(robot), left, bottom);
  }

  /** Thin frames around the places that a robot remembers. */
  memory(pen, robot) {
    const { run, view } = this;
    const sides = [0, view.objectPx(run.header.n_objects), Math.max(run.header.world.cache_side_m * view.scale, 10)];
    pen.strokeStyle = theme.colours.text;
    pen.lineWidth = 1;
    for (const [kind, x, y] of run.places(robot) ?? []) {
      const side = sides[kind] + 4;
      pen.strokeRect(view.px(x) - side / 2, view.py(y) - side / 2, side, side);
    }
  }
}
