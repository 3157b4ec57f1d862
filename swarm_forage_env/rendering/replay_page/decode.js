// From the text in the page to typed arrays. The twin of swarm_forage_env/inspect/replay/coding.py.

const ARRAY_TYPES = { u1: Uint8Array, u2: Uint16Array, i4: Int32Array, f4: Float32Array };

function bytesOfBase64(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Unpack a zlib stream that holds so many bytes; the browser checks its checksum. */
async function inflate(packed, size) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  if (bytes.length !== size) throw new Error("its data are damaged");
  return bytes;
}

/** Undo byte planes, zigzag and differences. The first axis of the array, of this length, is the last one here: the
 *  values of one robot lie together. */
function undoChanges(planes, type, length) {
  const size = type.BYTES_PER_ELEMENT;
  const count = planes.length / size;
  const values = new type(count);
  for (let start = 0; start < count; start += length) {
    let value = 0;
    for (let i = start; i < start + length; i++) {
      let zigzag = planes[i];
      for (let k = 1; k < size; k++) zigzag |= planes[k * count + i] << (8 * k);
      value = (value + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
      values[i] = value; // the typed array wraps it
    }
  }
  return values;
}

/** Unpack all arrays of a run, by name. */
async function unpackRun(header, text) {
  const packed = bytesOfBase64(text);
  const arrays = {};
  for (const { name, dtype, shape, offset, size } of header.arrays) {
    const type = ARRAY_TYPES[dtype];
    const length = shape.reduce((product, extent) => product * extent, type.BYTES_PER_ELEMENT);
    const raw = await inflate(packed.subarray(offset, offset + size), length);
    arrays[name] = dtype === "f4" ? new type(raw.buffer, 0, shape[0]) : undoChanges(raw, type, shape[0]);
  }
  return arrays;
}
