// The run of now in the form of a replay's, so that the same painter draws both. Its frames are the last seconds, which
// trails are drawn from; the last frame is the latest whole second.

const KEPT_S = 601; // the longest trail and one second

class LiveSwarm extends Run {
  constructor(header) {
    const none = new Int32Array(0);
    super({ ...header, n_frames: 0, frame_ticks: 1, end_tick: 0 },
      { object_events: none, cache_events: none, deliveries: none, status: new Uint8Array(0) });
    this.nFrames = KEPT_S;
    this.frameS = 1;
    this.frame = KEPT_S - 1;
    this.time = 0;
    this.seconds = -1; // whole seconds that have been kept
    this.arrays.status = new Uint8Array(KEPT_S * this.nRobots).fill(ABSENT);
    this.arrays.position = new Uint16Array(2 * KEPT_S * this.nRobots);
    this.objects = { at: () => this.now.objects };
    this.caches = { at: () => this.now.caches };
    this.dead = new Set();
  }

  /** Show another frame of the same run. */
  take(now) {
    this.now = now;
    this.time = now.time_s;
    this.x.set(now.x);
    this.y.set(now.y);
    this.turn.set(now.turn);
    this.status.set(now.status);
    this.dead = new Set(now.dead);
    const step = this.header.position_step_m;
    const metres = (column) => Float32Array.from(now.deliveries, (row) => step * row[column]);
    this.deliveries = {
      times: Float64Array.from(now.deliveries, (row) => row[0] * this.header.dt_s),
      x: metres(1),
      y: metres(2),
    };
    this.keep(Math.floor(now.time_s + 1e-9));
  }

  /** Keep the places of now for all seconds that have passed since the last look. */
  keep(second) {
    const passed = Math.min(KEPT_S, second - this.seconds);
    if (passed <= 0) return;
    this.seconds = second;
    const step = this.header.position_step_m;
    for (let robot = 0; robot < this.nRobots; robot++) {
      keepLast(this.arrays.status, robot * KEPT_S, passed, this.status[robot]);
      keepLast(this.arrays.position, 2 * robot * KEPT_S, passed, Math.round(this.x[robot] / step));
      keepLast(this.arrays.position, (2 * robot + 1) * KEPT_S, passed, Math.round(this.y[robot] / step));
    }
  }

  isDead(robot) {
    return this.dead.has(robot);
  }

  activity(robot) {
    return this.now.activity ? this.now.words[this.now.activity[robot]] : null;
  }

  places(robot) {
    return this.now.robot?.row === robot ? this.now.robot.places : null;
  }

  counted(name) {
    return this.now.counters[this.header.counters.indexOf(name)];
  }

  /** Number of robots whose status has some of these bits. */
  having(flags) {
    return this.status.reduce((sum, state) => sum + ((state & flags) !== 0), 0);
  }
}

/** Move a row of `KEPT_S` values on by some places, and fill these with a value. */
function keepLast(values, start, places, value) {
  values.copyWithin(start, start + places, start + KEPT_S);
  values.fill(value, start + KEPT_S - places, start + KEPT_S);
}
