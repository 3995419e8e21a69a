/**
 * The scalar types of the format (spec/README.md#types), coordinates and keys (spec/morton.md), and
 * little-endian access to bytes at any address.
 */

/** The least u64 that is no half of a key. */
export const KEY_LIMIT = 2n ** 63n;

/**
 * Returns a DataView over exactly the bytes of an array.
 * @param {Uint8Array} bytes
 */
export function viewOf(bytes) {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/**
 * Returns a u64 as a Number: exact below 2^53, and above it rounded, but never to less than 2^53.
 * Every limit of the format that such a number is compared with is below 2^53.
 * @param {DataView} view
 * @param {number} at offset in bytes
 */
export function u64(view, at) {
  return view.getUint32(at + 4, true) * 2 ** 32 + view.getUint32(at, true);
}

/** Returns the u64 at an offset of a view as a BigInt. */
export function big(view, at) {
  return view.getBigUint64(at, true);
}

/** Says whether all bytes from a position to another are zero. */
export function allZero(bytes, from = 0, to = bytes.length) {
  for (let i = from; i < to; i++) if (bytes[i] !== 0) return false;
  return true;
}

/** Says whether two byte arrays are equal. */
export function sameBytes(a, b) {
  return a.length === b.length && a.every((value, i) => value === b[i]);
}

/** Returns a number rounded up to the next multiple of a step. */
export function roundUp(value, step) {
  return Math.ceil(value / step) * step;
}

/**
 * Returns the text in a byte array, or undefined when the bytes are not well-formed UTF-8 without NUL.
 * @param {Uint8Array} bytes
 */
export function textOf(bytes) {
  if (bytes.includes(0)) return undefined;
  try {
    return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    return undefined;
  }
}

/** Says whether bytes are a name: 1 to 31 characters of a-z, 0-9, _ and the full stop. */
export function isName(bytes) {
  return bytes.length <= 31 && /^[a-z0-9_.]+$/.test(textOf(bytes) ?? "");
}

/** Returns the value of a half, IEEE 754 binary16. */
export function halfValue(bits) {
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  const sign = bits & 0x8000 ? -1 : 1;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1024 + fraction) * 2 ** (exponent - 25);
}

const word = new DataView(new ArrayBuffer(4));

/** Returns the value of a ufloat16: the upper 17 bits of a binary32 without its sign. */
export function ufloatValue(bits) {
  word.setUint32(0, bits * 2 ** 15);
  return word.getFloat32(0);
}

/** Greatest finite value of a ufloat16. */
export const UFLOAT_MAX = ufloatValue(0xfeff);

/** Returns the ufloat16 nearest to a number of at least 0, ties to even, at most 0xfeff. */
export function ufloatNearest(value) {
  let low = 0;
  let high = 0xfeff;
  if (value >= UFLOAT_MAX) return high;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (ufloatValue(middle) <= value) low = middle;
    else high = middle;
  }
  const below = value - ufloatValue(low);
  const above = ufloatValue(high) - value;
  return below < above || (below === above && low % 2 === 0) ? low : high;
}

/** Returns the three components of an rgbe. */
export function rgbeValue(bits) {
  const step = 2 ** ((bits >>> 24) - 136);
  return [(bits & 255) * step, ((bits >>> 8) & 255) * step, ((bits >>> 16) & 255) * step];
}

/**
 * Returns the unit vector that octahedral coordinates stand for.
 * @param {number} u
 * @param {number} v
 * @param {number} q 32767 or 127
 * @returns {number[]} x, y, z
 */
export function octahedral(u, v, q) {
  let a = Math.max(u, -q);
  let b = Math.max(v, -q);
  const c = q - Math.abs(a) - Math.abs(b);
  if (c < 0) {
    const folded = (q - Math.abs(b)) * (a < 0 ? -1 : 1);
    b = (q - Math.abs(a)) * (b < 0 ? -1 : 1);
    a = folded;
  }
  // These are integers, which have no negative zero; adding 0 turns it into zero.
  const length = Math.sqrt(a * a + b * b + c * c);
  return [(a + 0) / length, (b + 0) / length, c / length];
}

/** Spreads 21 bits to every third bit of 63. */
function spread(bits) {
  let result = 0n;
  for (let i = 0; i < 21; i++) if ((bits >>> i) & 1) result |= 1n << BigInt(3 * i);
  return result;
}

/** Gathers every third bit of 63 into 21 bits, from bit `axis` on. */
function gather(half, axis) {
  let result = 0;
  for (let i = 0; i < 21; i++) {
    if ((half >> BigInt(3 * i + axis)) & 1n) result += 2 ** i;
  }
  return result;
}

/** Returns the high half of the key of a lattice point. */
export function keyHigh(x, y, z) {
  const top = (value) => Math.floor(value / 2 ** 21);
  return spread(top(x)) | (spread(top(y)) << 1n) | (spread(top(z)) << 2n);
}

/** Returns the lattice point of a key as [x, y, z]. */
export function pointOfKey(high, low) {
  return [0, 1, 2].map((axis) => gather(high, axis) * 2 ** 21 + gather(low, axis));
}

/** Says whether the highest set bit of a is below that of b, both 21 bits. */
function lowerBit(a, b) {
  return a < b && a < (a ^ b);
}

/**
 * Compares two lattice points along the Z-curve.
 * @returns {number} below 0, 0 or above 0 as the first point lies before, at or after the second
 */
export function compareKeys(ax, ay, az, bx, by, bz) {
  return (
    compareHalves(Math.floor(ax / 2 ** 21), Math.floor(ay / 2 ** 21), Math.floor(az / 2 ** 21),
      Math.floor(bx / 2 ** 21), Math.floor(by / 2 ** 21), Math.floor(bz / 2 ** 21)) ||
    compareHalves(ax % 2 ** 21, ay % 2 ** 21, az % 2 ** 21, bx % 2 ** 21, by % 2 ** 21, bz % 2 ** 21)
  );
}

/** Compares two triples of 21 bits each along the Z-curve. */
function compareHalves(ax, ay, az, bx, by, bz) {
  let most = az ^ bz;
  let difference = az - bz;
  if (lowerBit(most, ay ^ by)) {
    most = ay ^ by;
    difference = ay - by;
  }
  if (lowerBit(most, ax ^ bx)) difference = ax - bx;
  return difference;
}
