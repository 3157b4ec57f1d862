// Where the arena lies in a canvas: metres to pixels, and zooming. All panels share one camera, so that they show the
// same place; each fits its own arena.

const MAX_ZOOM = 40;
const MARGIN_PX = 8;

class Camera {
  constructor() {
    this.reset();
  }

  reset() {
    this.zoom = 1;
    this.x = 0.5; // centre, as shares of the arena
    this.y = 0.5;
  }

  clamp() {
    const half = 0.5 / this.zoom;
    this.x = Math.min(1 - half, Math.max(half, this.x));
    this.y = Math.min(1 - half, Math.max(half, this.y));
  }
}

class View {
  constructor(world, camera) {
    this.world = world;
    this.camera = camera;
    this.followed = null; // a place in m that stays in the middle, in place of the camera's
    this.resize(100, 100);
  }

  resize(width, height) {
    this.width = width;
    this.height = height;
    const { width_m, height_m } = this.world;
    this.fit = Math.min((width - 2 * MARGIN_PX) / width_m, (height - 2 * MARGIN_PX) / height_m);
  }

  get scale() {
    return this.fit * this.camera.zoom;
  }

  /** What is in the middle, m. */
  get middle() {
    const { x, y, zoom } = this.camera;
    const { width_m, height_m } = this.world;
    if (!this.followed) return { x: x * width_m, y: y * height_m };
    const within = (place, extent) => Math.min(extent - (0.5 * extent) / zoom, Math.max((0.5 * extent) / zoom, place));
    return { x: within(this.followed.x, width_m), y: within(this.followed.y, height_m) };
  }

  /** Work out, once per picture, where the arena's corner lies. */
  settle() {
    const { x, y } = this.middle;
    this.left = this.width / 2 - x * this.scale;
    this.bottom = this.height / 2 + y * this.scale;
  }

  px(x) {
    return this.left + x * this.scale;
  }

  py(y) {
    return this.bottom - y * this.scale;
  }

  metres(px, py) {
    return [this.middle.x + (px - this.width / 2) / this.scale, this.middle.y - (py - this.height / 2) / this.scale];
  }

  /** Zoom by a factor; what lies under the pixel stays there. */
  zoomAt(px, py, factor) {
    const [x, y] = this.metres(px, py);
    this.camera.zoom = Math.min(MAX_ZOOM, Math.max(1, this.camera.zoom * factor));
    const [newX, newY] = this.metres(px, py);
    this.moveBy(x - newX, y - newY);
  }

  /** Move the camera by metres. */
  moveBy(x, y) {
    this.camera.x += x / this.world.width_m;
    this.camera.y += y / this.world.height_m;
    this.camera.clamp();
  }

  /** Radius of a robot: its own, but never too small to see, nor so large that a swarm covers the floor. */
  robotPx(nRobots) {
    const gap = this.fit * Math.sqrt((this.world.width_m * this.world.height_m) / nRobots);
    const least = Math.min(4.6, Math.max(1.3, 0.075 * gap)) * Math.sqrt(this.camera.zoom);
    return Math.max(this.world.robot_radius_m * this.scale, least);
  }

  objectPx(nObjects) {
    const gap = this.fit * Math.sqrt((this.world.width_m * this.world.height_m) / nObjects);
    const least = Math.min(3, Math.max(1, 0.3 * gap)) * Math.sqrt(this.camera.zoom);
    return Math.max(0.8 * this.world.cell_m * this.scale, least);
  }
}
