// The arenas: one canvas per run, side by side, and what pointers do there.

const TAP_PX = 6; // a pointer that moved less was a click
const LENGTHS_M = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100]; // of the scale beside the name
const REACH_PX = 16; // how near a click must come to a robot

/** What is looked at: the same robot in all runs. */
const focus = { chosen: -1, hovered: -1, follows: false, panel: null };

/** A name that may go on in another line behind each _ , or =. */
function breakable(name) {
  return name.split(/(?<=[_,=])/).flatMap((part) => [part, document.createElement("wbr")]);
}

class Panel {
  constructor(parent, run, camera, page) {
    this.run = run;
    this.page = page;
    this.view = new View(run.header.world, camera);
    this.painter = new Painter(run, this.view);
    this.box = document.createElement("figure");
    this.box.className = "arena";
    this.box.style.margin = "0";
    this.box.innerHTML = `<figcaption class="caption"><i class="swatch"></i><span class="name"></span>
      <span class="scale"></span><span class="amount"></span><span class="unit"></span></figcaption><canvas></canvas>`;
    this.box.querySelector(".name").append(...breakable(run.header.label));
    this.box.querySelector(".unit").textContent = run.header.performance.words;
    this.amount = this.box.querySelector(".amount");
    this.scale = this.box.querySelector(".scale");
    this.canvas = this.box.querySelector("canvas");
    this.canvas.setAttribute("aria-label", `arena of ${run.header.label}`);
    parent.append(this.box);
    this.pointers = new Map();
    this.listen();
  }

  resize(width, height) {
    this.pen = sizeCanvas(this.canvas, width, height);
    this.view.resize(width, height);
  }

  paint(speed) {
    const { run } = this;
    this.canvas.classList.toggle("zoomed", this.view.camera.zoom > 1);
    this.painter.paint(this.pen, { ...focus, speed });
    this.canvas.classList.toggle("over", focus.hovered >= 0);
    const metres = LENGTHS_M.findLast((length) => length * this.view.scale <= this.view.width / 6) ?? 0.1;
    this.scale.textContent = `${metres} m`;
    this.scale.style.width = `${metres * this.view.scale}px`;
    this.amount.textContent = run.counted(run.header.performance.counter).toLocaleString("en");
  }

  theme() {
    this.box.querySelector(".swatch").style.background = theme.ofRun(this.run);
  }

  place(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  /** The robot next to a pixel, or -1 where none is near. */
  robotAt(px, py) {
    const { run, view } = this;
    let nearest = -1;
    let least = Math.max(REACH_PX, 1.5 * view.robotPx(run.nRobots)) ** 2;
    for (let robot = 0; robot < run.nRobots; robot++) {
      if (run.status[robot] & ABSENT) continue;
      const distance = (view.px(run.x[robot]) - px) ** 2 + (view.py(run.y[robot]) - py) ** 2;
      if (distance < least) [nearest, least] = [robot, distance];
    }
    return nearest;
  }

  listen() {
    const on = (name, action) => this.canvas.addEventListener(name, (event) => action.call(this, event));
    on("pointerdown", this.press);
    on("pointermove", this.move);
    on("pointerup", this.release);
    on("pointercancel", this.release);
    on("pointerleave", this.leave);
    on("wheel", this.wheel);
    on("dblclick", () => this.page.showWhole());
  }

  press(event) {
    if (event.button > 0) return;
    this.pointers.set(event.pointerId, this.place(event));
    this.start = this.place(event);
    this.isTap = this.pointers.size === 1;
    this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const here = this.place(event);
    if (!this.pointers.has(event.pointerId)) {
      this.hover(event, here);
      return;
    }
    if (Math.hypot(here[0] - this.start[0], here[1] - this.start[1]) > TAP_PX) this.isTap = false;
    if (!this.isTap) this.drag(event.pointerId, here);
    this.pointers.set(event.pointerId, here);
  }

  /** One pointer moves the arena; two zoom it around the point between them. */
  drag(id, here) {
    const before = this.pointers.get(id);
    const others = [...this.pointers].filter(([other]) => other !== id).map(([, place]) => place);
    const scale = this.view.scale;
    if (others.length === 0) {
      this.page.stopFollowing?.(this.view);
      this.view.moveBy((before[0] - here[0]) / scale, (here[1] - before[1]) / scale);
    } else {
      const fixed = others[0];
      const was = Math.hypot(before[0] - fixed[0], before[1] - fixed[1]);
      const is = Math.hypot(here[0] - fixed[0], here[1] - fixed[1]);
      if (was > 0) this.view.zoomAt((here[0] + fixed[0]) / 2, (here[1] + fixed[1]) / 2, is / was);
    }
    this.page.repaint();
  }

  release(event) {
    const wasTap = this.isTap && this.pointers.has(event.pointerId) && event.type === "pointerup";
    this.pointers.delete(event.pointerId);
    if (wasTap) this.page.choose(this.robotAt(...this.place(event)), this);
    this.isTap = false;
  }

  hover(event, here) {
    if (event.pointerType === "touch") return; // a finger covers what it points at; it chooses instead
    focus.hovered = this.robotAt(...here);
    focus.panel = this;
    this.page.showTip(this, event);
  }

  leave() {
    focus.hovered = -1;
    this.page.hideTip();
  }

  wheel(event) {
    event.preventDefault();
    this.view.zoomAt(...this.place(event), Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0018)));
    this.page.repaint();
  }
}

const WORTH_A_ROW = 1.25; // panels must become this much wider for another row, which pushes the curves down

/** Columns of panels that use a room well, and width and height of a canvas. */
function bestGrid(count, aspect, width, height, gap, captionPx) {
  let best = { width: 0 };
  for (let columns = count; columns >= 1; columns--) {
    const rows = Math.ceil(count / columns);
    const most = (width - gap * (columns - 1)) / columns - 2;
    const tallest = (height - gap * (rows - 1)) / rows - captionPx;
    const wide = Math.floor(Math.min(most, Math.max(60, tallest) * aspect));
    if (wide > WORTH_A_ROW * best.width) best = { columns, width: wide, height: Math.floor(wide / aspect) };
  }
  return best;
}
