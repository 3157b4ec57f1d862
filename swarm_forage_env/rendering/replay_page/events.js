// Tables that change by events: objects and caches. Each row has three numbers; an event sets those of one row.

const CHECKPOINT_EVENTS = 2000; // a jump applies at most this many events

/** First index of a sorted array whose value is above the limit. */
function countUpTo(sorted, limit) {
  let low = 0;
  let high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

class EventTable {
  /** `events` holds five columns one after the other: frame, row, and the three numbers. */
  constructor(events, rows) {
    const count = events.length / 5;
    [this.frames, this.rows, this.a, this.b, this.c] = [0, 1, 2, 3, 4].map((k) =>
      events.subarray(k * count, (k + 1) * count),
    );
    this.count = count;
    this.values = new Int32Array(3 * rows).fill(-1);
    this.applied = 0;
    this.checkpoints = [];
    for (this.applied = 0; this.applied < count; ) {
      if (this.applied % CHECKPOINT_EVENTS === 0) this.checkpoints.push(this.values.slice());
      this.applyNext();
    }
  }

  applyNext() {
    const i = this.applied++;
    const at = 3 * this.rows[i];
    this.values[at] = this.a[i];
    this.values[at + 1] = this.b[i];
    this.values[at + 2] = this.c[i];
  }

  /** The table as it was at a frame; valid until the next call. */
  at(frame) {
    const wanted = countUpTo(this.frames, frame);
    if (wanted < this.applied || wanted > this.applied + CHECKPOINT_EVENTS) this.jump(wanted);
    while (this.applied < wanted) this.applyNext();
    return this.values;
  }

  jump(wanted) {
    const checkpoint = Math.min(Math.floor(wanted / CHECKPOINT_EVENTS), this.checkpoints.length - 1);
    if (checkpoint < 0) return;
    this.values.set(this.checkpoints[checkpoint]);
    this.applied = checkpoint * CHECKPOINT_EVENTS;
  }
}
