// From zlib streams to bytes (RFC 1950 and 1951), at once. The browser's own DecompressionStream answers later: pictures
// and prints that are made as soon as the page is loaded then show no run.

const CODE_ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
const MOST_BITS = 15; // of a code
const LENGTH_BITS = [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0];
const BACK_BITS = [0, 0, 0, 0, ...Array.from({ length: 26 }, (_, k) => (k >> 1) + 1)];
const LENGTH_START = [...startsOf(3, LENGTH_BITS.slice(0, -1)), 258];
const BACK_START = startsOf(1, BACK_BITS);
const FIXED_LENGTHS = Array.from({ length: 288 }, (_, k) => (k < 144 ? 8 : k < 256 ? 9 : k < 280 ? 7 : 8));

/** First numbers of classes that follow each other, each of 2 ** bits numbers. */
function startsOf(first, bits) {
  let next = first;
  return bits.map((extra) => {
    const start = next;
    next += 1 << extra;
    return start;
  });
}

/** What the next bits of a stream mean: 16 * symbol + length of its code, or 0 where they are no code. */
function codeTable(lengths) {
  const counts = new Uint16Array(MOST_BITS + 1);
  for (const length of lengths) if (length) counts[length]++;
  const next = new Uint16Array(MOST_BITS + 1);
  for (let length = 1, code = 0; length <= MOST_BITS; length++) {
    next[length] = code;
    code = (code + counts[length]) << 1;
  }
  const table = new Uint16Array(1 << Math.max(1, ...lengths));
  lengths.forEach((length, symbol) => {
    if (!length) return;
    let code = next[length]++;
    let place = 0; // the code with its first bit lowest, as it comes
    for (let bit = 0; bit < length; bit++, code >>= 1) place = (place << 1) | (code & 1);
    for (; place < table.length; place += 1 << length) table[place] = 16 * symbol + length;
  });
  return table;
}

class Inflater {
  constructor(packed, size) {
    this.packed = packed;
    this.bytes = new Uint8Array(size);
    this.done = 0;
    this.at = 2; // behind the header of zlib
    this.held = 0; // bits that are taken from `packed` and not yet used
    this.count = 0; // how many they are
  }

  take(count) {
    while (this.count < count) {
      if (this.at >= this.packed.length) throw new Error("its data are cut short");
      this.held |= this.packed[this.at++] << this.count;
      this.count += 8;
    }
    const value = this.held & ((1 << count) - 1);
    this.held >>>= count;
    this.count -= count;
    return value;
  }

  all() {
    for (let isLast = 0; !isLast; ) {
      isLast = this.take(1);
      const kind = this.take(2);
      if (kind === 0) this.copy();
      else if (kind === 1) this.decode(codeTable(FIXED_LENGTHS), codeTable(new Array(30).fill(5)));
      else if (kind === 2) this.decode(...this.codes());
      else throw new Error("its data are damaged");
    }
    if (this.done !== this.bytes.length || this.sum() !== this.storedSum()) throw new Error("its data are damaged");
    return this.bytes;
  }

  /** The checksum of zlib, Adler-32. */
  sum() {
    let [low, high] = [1, 0];
    for (let start = 0; start < this.done; start += 3800) { // so far, no sum leaves 32 bits
      const end = Math.min(this.done, start + 3800);
      for (let k = start; k < end; k++) high += low += this.bytes[k];
      low %= 65521;
      high %= 65521;
    }
    return low + 65536 * high;
  }

  storedSum() {
    const last = this.at - (this.count >> 3); // whole bytes that were taken too early
    return this.packed.subarray(last, last + 4).reduce((sum, byte) => 256 * sum + byte, 0);
  }

  /** A block that is not compressed. */
  copy() {
    this.at -= this.count >> 3; // whole bytes that were taken too early
    this.held = this.count = 0;
    const size = this.packed[this.at] | (this.packed[this.at + 1] << 8);
    this.bytes.set(this.packed.subarray(this.at + 4, this.at + 4 + size), this.done);
    this.at += 4 + size;
    this.done += size;
  }

  /** The codes of a block that brings its own: of bytes and lengths, and of distances. */
  codes() {
    const nBytes = this.take(5) + 257;
    const nBack = this.take(5) + 1;
    const lengthsOfLengths = new Array(19).fill(0);
    for (let k = 0, count = this.take(4) + 4; k < count; k++) lengthsOfLengths[CODE_ORDER[k]] = this.take(3);
    const table = codeTable(lengthsOfLengths);
    const lengths = [];
    while (lengths.length < nBytes + nBack) {
      const symbol = this.symbol(table);
      if (symbol < 16) lengths.push(symbol);
      else if (symbol === 16) lengths.push(...new Array(3 + this.take(2)).fill(lengths.at(-1)));
      else lengths.push(...new Array(symbol === 17 ? 3 + this.take(3) : 11 + this.take(7)).fill(0));
    }
    return [codeTable(lengths.slice(0, nBytes)), codeTable(lengths.slice(nBytes))];
  }

  symbol(table) {
    while (this.count < MOST_BITS) {
      this.held |= this.packed[this.at++] << this.count; // behind the end, 0: the last code may need fewer bits
      this.count += 8;
    }
    const entry = table[this.held & (table.length - 1)];
    if (entry === 0 || this.at > this.packed.length + 2) throw new Error("its data are damaged");
    this.held >>>= entry & 15;
    this.count -= entry & 15;
    return entry >> 4;
  }

  decode(byteTable, backTable) {
    const { packed, bytes } = this;
    const mask = byteTable.length - 1;
    for (;;) {
      // Most of the time goes into single bytes, so they have a loop of their own, in variables of its own.
      let { held, count, at, done } = this;
      let entry = 0;
      for (;;) {
        while (count < MOST_BITS) {
          held |= packed[at++] << count; // behind the end, 0
          count += 8;
        }
        entry = byteTable[held & mask];
        if (entry === 0 || entry >= 16 * 256 || done === bytes.length) break;
        held >>>= entry & 15;
        count -= entry & 15;
        bytes[done++] = entry >> 4;
      }
      this.held = held;
      this.count = count;
      this.at = at;
      this.done = done;
      const symbol = this.symbol(byteTable);
      if (symbol === 256) return;
      this.repeat(LENGTH_START[symbol - 257] + this.take(LENGTH_BITS[symbol - 257]), this.symbol(backTable));
    }
  }

  /** Write so many bytes again, from as far back as a class of distances says. */
  repeat(length, back) {
    const { bytes } = this;
    const from = this.done - BACK_START[back] - this.take(BACK_BITS[back]);
    const end = this.done + length;
    if (!(from >= 0 && end <= bytes.length)) throw new Error("its data are damaged");
    for (let to = this.done, k = from; to < end; to++, k++) bytes[to] = bytes[k];
    this.done = end;
  }
}

/** Unpack a zlib stream that holds so many bytes. */
function inflate(packed, size) {
  return new Inflater(packed, size).all();
}
