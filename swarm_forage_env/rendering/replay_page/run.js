// One run: what was where at a time. Rows are robots; the values of one robot over time lie together.

const CARRYING = 1;
const INTERFERING = 2;
const REPAIR = 4;
const ABSENT = 8;
const HANDLING = 128;
const TASK_SHIFT = 4;
const CARRIED = 1; // status of an object
const FREE = 0;

/** Slope of a curve at a sample, so that the curve neither overshoots nor rings: zero where it turns. */
function slope(before, after) {
  return before * after <= 0 ? 0 : (2 * before * after) / (before + after);
}

/** Cubic from y1 to y2 with the neighbours y0 and y3, at a share in [0, 1]. */
function between(y0, y1, y2, y3, share) {
  const step = y2 - y1;
  if (step === 0) return y1;
  const start = slope(y1 - y0, step);
  const end = slope(step, y3 - y2);
  const rest = 1 - share;
  return (
    y1 + share * share * (3 - 2 * share) * step + share * rest * rest * start - share * share * rest * end
  );
}

class Run {
  constructor(header, arrays) {
    this.header = header;
    this.look = header.look;
    this.arrays = arrays;
    this.nRobots = header.n_robots;
    this.nFrames = header.n_frames;
    this.frameS = header.frame_ticks * header.dt_s;
    this.endS = header.end_tick * header.dt_s;
    this.objects = new EventTable(arrays.object_events, header.n_objects);
    this.caches = new EventTable(arrays.cache_events, header.n_cache_slots);
    this.x = new Float32Array(this.nRobots);
    this.y = new Float32Array(this.nRobots);
    this.turn = new Float32Array(this.nRobots);
    this.status = new Uint8Array(this.nRobots);
    this.deliveries = this.findDeliveries();
    this.firstSeen = Int32Array.from({ length: this.nRobots }, (_, robot) => this.firstFrameOf(robot));
  }

  /** The first frame in which a robot is in the world. */
  firstFrameOf(robot) {
    const row = robot * this.nFrames;
    let frame = 0;
    while (frame < this.nFrames && this.arrays.status[row + frame] & ABSENT) frame++;
    return frame;
  }

  /** Whether a robot that was in the world before a frame is not there any more. One not yet born is not dead. */
  isDead(robot, frame = this.frame) {
    return this.firstSeen[robot] < frame && (this.arrays.status[robot * this.nFrames + frame] & ABSENT) !== 0;
  }

  timeOf(frame) {
    return Math.min(frame * this.frameS, this.endS);
  }

  /** The frame at or before a time, and the share of the way to the next one. */
  frameAt(time) {
    const frame = Math.max(0, Math.min(this.nFrames - 1, Math.floor(time / this.frameS + 1e-9)));
    if (time >= this.endS) return { frame: this.nFrames - 1, share: 0 };
    const span = this.timeOf(frame + 1) - this.timeOf(frame);
    return { frame, share: span > 0 ? Math.min(1, Math.max(0, (time - this.timeOf(frame)) / span)) : 0 };
  }

  /** Let x, y, turn and status be those of a time. */
  seek(time) {
    const { frame, share } = this.frameAt(time);
    const last = this.nFrames - 1;
    const [f0, f2, f3] = [Math.max(0, frame - 1), Math.min(last, frame + 1), Math.min(last, frame + 2)];
    const { position, heading, status } = this.arrays;
    const step = this.header.position_step_m;
    for (let robot = 0; robot < this.nRobots; robot++) {
      const row = robot * this.nFrames;
      const ofX = 2 * robot * this.nFrames;
      const ofY = ofX + this.nFrames;
      const state = status[row + frame];
      this.status[robot] = state;
      // One that is born, or was away, does not glide to where it appears.
      const still = share === 0 || ((state ^ status[row + f2]) & ABSENT) !== 0;
      const way = still ? 0 : share;
      this.x[robot] =
        step * between(position[ofX + f0], position[ofX + frame], position[ofX + f2], position[ofX + f3], way);
      this.y[robot] =
        step * between(position[ofY + f0], position[ofY + frame], position[ofY + f2], position[ofY + f3], way);
      const turned = ((heading[row + f2] - heading[row + frame] + 384) % 256) - 128; // the shorter way round
      this.turn[robot] = ((heading[row + frame] + way * turned) * Math.PI) / 128;
    }
    this.frame = frame;
    this.time = time;
  }

  task(robot) {
    return (this.status[robot] >> TASK_SHIFT) & 7;
  }

  activity(robot) {
    const codes = this.arrays.activity;
    return codes ? this.header.activities[codes[robot * this.nFrames + this.frame]] : null;
  }

  /** Places that a robot remembers, as [1 for an object or 2 for a cache, x, y in m], or null where nobody tells. */
  places(robot) {
    const events = this.arrays.memory_events;
    if (!events) return null;
    const count = events.length / 5;
    const [frames, robots, changes, x, y] = [0, 1, 2, 3, 4].map((k) => events.subarray(k * count, (k + 1) * count));
    const places = new Map();
    for (let i = countUpTo(robots, robot - 1); i < count && robots[i] === robot && frames[i] <= this.frame; i++) {
      const key = [Math.abs(changes[i]), x[i], y[i]].join();
      if (changes[i] < 0) places.delete(key);
      else places.set(key, [changes[i], this.header.position_step_m * x[i], this.header.position_step_m * y[i]]);
    }
    return [...places.values()];
  }

  /** Row of the object that a robot carries, or -1. */
  cargo(robot) {
    const values = this.objects.at(this.frame);
    for (let row = 0; row < this.header.n_objects; row++) {
      if (values[3 * row] === CARRIED && values[3 * row + 1] === robot) return row;
    }
    return -1;
  }

  /** What had been counted up to a frame, by name. */
  counted(name, frame = this.frame) {
    return this.arrays.counters[this.header.counters.indexOf(name) * this.nFrames + frame];
  }

  /** Deliveries: times in s, in order, and places in m. */
  findDeliveries() {
    const { deliveries } = this.arrays;
    const count = deliveries.length / 4;
    const [ticks, , x, y] = [0, 1, 2, 3].map((column) => deliveries.subarray(column * count, (column + 1) * count));
    const step = this.header.position_step_m;
    const metres = (steps) => Float32Array.from(steps, (value) => step * value);
    return { times: Float64Array.from(ticks, (tick) => tick * this.header.dt_s), x: metres(x), y: metres(y) };
  }
}
