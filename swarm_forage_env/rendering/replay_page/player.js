// The clock of the page: what time it is in all runs, and whether it runs.

const SPEEDS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

class Player {
  constructor(endS) {
    this.endS = endS;
    this.time = 0;
    this.speed = 20;
    this.playing = false;
    this.dirty = true; // whether something is to be painted anew
    this.last = 0;
  }

  /** Advance to the next picture; `now` in ms. */
  tick(now) {
    const passed = Math.min(100, now - this.last) / 1000; // a tab that slept goes on where it was
    this.last = now;
    if (!this.playing) return;
    this.seek(this.time + passed * this.speed);
    if (this.time >= this.endS) this.pause();
  }

  seek(time) {
    this.time = Math.min(this.endS, Math.max(0, time));
    this.dirty = true;
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.time >= this.endS) this.time = 0;
    this.playing = true;
    this.dirty = true;
  }

  pause() {
    this.playing = false;
    this.dirty = true;
  }

  /** Faster or slower by some steps of `SPEEDS`. */
  shift(steps) {
    const at = SPEEDS.indexOf(this.speed) + steps;
    this.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, at))];
    this.dirty = true;
  }
}
