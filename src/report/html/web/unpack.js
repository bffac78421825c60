// Unpacks data to arrays. The counterpart of `pack.rs`.

const NO_NUMBER = 65535;
const NO_COUNT = 2 ** 32 - 1;

async function inflated(id) {
  // Replays are at the end of the file, which may still be loading.
  if (!document.getElementById(`data-${id}`) && document.readyState === "loading") {
    await new Promise((done) => document.addEventListener("DOMContentLoaded", done, { once: true }));
  }
  const element = document.getElementById(`data-${id}`);
  if (!element) throw new Error(`the part ${id} is not in this file`);
  return inflatedOf(element.textContent);
}

/** The bytes of a part, from its letters. */
function inflatedOf(letters) {
  const bytes = Uint8Array.fromBase64 ? Uint8Array.fromBase64(letters)
    : Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

/** The text of a part. */
async function unpackText(id) {
  return textOf(await inflated(id));
}

function textOf(buffer) {
  return new TextDecoder().decode(buffer);
}

/** The header of a part, with its array descriptors replaced by the arrays. */
async function unpack(id) {
  return unpacked(await inflated(id));
}

function unpacked(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const body = 4 + length;
  const found = (value) => {
    if (Array.isArray(value)) return value.length && typeof value[0] === "object" ? value.map(found) : value;
    if (value === null || typeof value !== "object") return value;
    if (typeof value.at === "number" && typeof value.kind === "string" && "length" in value) return array(value, buffer, body);
    for (const key of Object.keys(value)) value[key] = found(value[key]);
    return value;
  };
  return found(head);
}

function array(told, buffer, body) {
  const at = body + told.at;
  switch (told.kind) {
    case "u8": return new Uint8Array(buffer, at, told.length);
    case "u16": return new Uint16Array(buffer, at, told.length);
    case "u32": return new Uint32Array(buffer, at, told.length);
    case "count": return Float64Array.from(new Uint32Array(buffer, at, told.length), (value) => value === NO_COUNT ? NaN : value);
    case "number": return numbers(new Uint16Array(buffer, at, told.length), told);
    case "courses": return { bytes: new Uint8Array(buffer, at), frames: told.length };
    default: throw new Error(`unknown array kind ${told.kind}`);
  }
}

/** Numbers, with NaN for missing values. */
function numbers(codes, { low, step, whole }) {
  const values = new Float64Array(codes.length);
  for (let i = 0; i < codes.length; i++) {
    const value = low + codes[i] * step;
    values[i] = codes[i] === NO_NUMBER ? NaN : whole ? Math.round(value) : value;
  }
  return values;
}

/** Decodes columns of integers from second differences: all low bytes, then all high bytes. */
function columnsOf({ bytes, frames }, count) {
  const total = frames * count;
  const columns = [];
  for (let column = 0, at = 0; column < count; column++) {
    const values = new Int16Array(frames);
    let last = 0, step = 0;
    for (let frame = 0; frame < frames; frame++, at++) {
      const value = (last + step + (bytes[at] | (bytes[total + at] << 8))) << 16 >> 16;
      step = value - last;
      last = value;
      values[frame] = value;
    }
    columns.push(values);
  }
  return columns;
}
