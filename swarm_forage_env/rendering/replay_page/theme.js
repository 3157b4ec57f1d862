// Light or dark, and the colours of the style sheet for those who draw.

const theme = {
  colours: {},
  isChosen: false,

  /** Take the reader's choice, else the system's. */
  start() {
    const system = matchMedia("(prefers-color-scheme: dark)");
    this.set(system.matches ? "dark" : "light");
    returnKeys();
    system.addEventListener("change", () => {
      if (!this.isChosen) this.set(system.matches ? "dark" : "light");
    });
  },

  set(name) {
    document.documentElement.dataset.theme = name;
    const style = getComputedStyle(document.documentElement);
    const names = ["page", "panel", "line", "text", "faint", "accent", "wall", "floor", "nest", "light", "source",
      "cache", "object", "empty", "carrying", "interference", "repair", "grid"];
    for (let k = 0; k < 8; k++) names.push(`task-${k}`);
    for (let k = 0; k < 8; k++) names.push(`run-${k}`);
    this.colours = Object.fromEntries(names.map((key) => [key, style.getPropertyValue(`--${key}`).trim()]));
    document.dispatchEvent(new Event("themed"));
  },

  toggle() {
    this.isChosen = true;
    this.set(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  },

  /** The colour that a run's policy has in figures. */
  ofRun(run) {
    return this.colours[`run-${run.look}`];
  },
};

/** Write facts below the headline; where there are many, a click unfolds them. */
function showFacts(facts) {
  const line = document.getElementById("subtitle");
  line.textContent = line.title = facts.join("  ·  ");
  line.onclick = () => line.classList.toggle("whole");
}

/** Whether a key is for the element that has it, and not for the page. */
function isTyping(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("keys").open) return true;
  if (event.key === " " && event.target.matches("button")) return true; // chosen by keys, see `returnKeys`
  return event.target.matches("select, input[type=number]");
}

/** A button or a choice that a pointer has used does not keep the keys, which are the page's again. */
function returnKeys() {
  let byPointer = false;
  addEventListener("pointerdown", () => { byPointer = true; }, true);
  addEventListener("keydown", () => { byPointer = false; }, true);
  addEventListener("click", ({ target }) => byPointer && target.closest("button")?.blur());
  addEventListener("change", ({ target }) => byPointer && target.closest("select")?.blur());
}

/** A canvas of this many CSS pixels, sharp on dense screens; returns its context. */
function sizeCanvas(canvas, width, height) {
  const density = Math.min(devicePixelRatio || 1, 2);
  canvas.width = Math.round(width * density);
  canvas.height = Math.round(height * density);
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  const pen = canvas.getContext("2d");
  pen.setTransform(density, 0, 0, density, 0, 0);
  return pen;
}
