/** What the payloads of point pages (spec/points.md) and of node pages (spec/nodes.md) hold. */

import { need } from "./rules.js";
import { allZero, big, compareKeys, KEY_LIMIT, roundUp, viewOf } from "./values.js";

/**
 * The points of a page, a typed array for each quantity.
 * @typedef {object} Points
 * @property {number} count
 * @property {Float64Array[]} position x, y, z as lattice coordinates, 0 to 2^42 - 1
 * @property {Float32Array} radius scene units
 * @property {Int16Array[]} normal u, v of octahedral16
 * @property {Uint16Array[]} radiance r, g, b, bits of halves
 * @property {Uint8Array[]} albedo r, g, b
 * @property {Uint16Array[]} emission r, g, b, bits of halves; empty when points have none
 */

/**
 * Reads and checks the payload of a point page.
 * @param {Uint8Array} payload
 * @param {number} pointBytes 34 or 40
 * @param {number} offset of the page in the file
 * @param {number} page its number
 * @returns {Points}
 */
export function readPoints(payload, pointBytes, offset, page) {
  const n = payload.length / pointBytes;
  const check = (good, rule, text) => need(good, `points.md#${rule}`, offset, text, page);
  check(Number.isInteger(n) && n >= 1, "point-size", "the payload does not hold whole points");
  const column = (Type, at) => new Type(payload.slice(at * n, at * n + Type.BYTES_PER_ELEMENT * n).buffer);
  const columns = (Type, at) => [0, 1, 2].map((k) => column(Type, at + k * Type.BYTES_PER_ELEMENT));
  const high = column(Uint32Array, 12);
  check(high.every((bits) => bits < 2 ** 30), "point-lattice", "a position is outside the lattice");
  const position = columns(Uint32Array, 0).map((low, axis) =>
    Float64Array.from(low, (bits, i) => ((high[i] >>> (10 * axis)) & 1023) * 2 ** 32 + bits));
  const [x, y, z] = position;
  for (let i = 1; i < n; i++) {
    check(compareKeys(x[i - 1], y[i - 1], z[i - 1], x[i], y[i], z[i]) <= 0, "point-order",
      `point ${i} of the page lies before the one ahead of it`);
  }
  const sound = column(Uint32Array, 16).every((bits) => bits < 0x7f800000);
  check(sound, "point-radius", "a radius is negative, infinite or NaN");
  const radiance = columns(Uint16Array, 24);
  const emission = pointBytes === 40 ? columns(Uint16Array, 34) : [];
  for (const colour of [...radiance, ...emission]) {
    check(colour.every((bits) => bits < 0x7c00), "point-radiance",
      "radiance or emission is negative, infinite or NaN");
  }
  check(column(Uint8Array, 33).every((flags) => flags === 0), "point-flags", "a reserved flag is set");
  return { count: n, position, radius: column(Float32Array, 16),
    normal: [column(Int16Array, 20), column(Int16Array, 22)], radiance, albedo: columns(Uint8Array, 30), emission };
}

/**
 * A group of sibling nodes; columns have a value for each child.
 * @typedef {object} Group
 * @property {bigint} cellHigh
 * @property {bigint} cellLow
 * @property {number} level 0 to 62
 * @property {boolean} emits whether a point below emits light
 * @property {({page: number, slot: number}|{first: number, count: number})[]} children a group, or a run of points
 * @property {Uint16Array[]} mean x, y, z in the group's cell
 * @property {Uint16Array} radius ufloat16
 * @property {Int8Array[]} coneAxis u, v of octahedral8
 * @property {Int16Array} coneCos snorm16
 * @property {Uint16Array} area ufloat16
 * @property {Uint16Array} thickness ufloat16
 * @property {Uint16Array} greatest ufloat16
 * @property {Uint16Array[]} facing unorm16, for each of the six axes
 * @property {Uint32Array[]} radiance rgbe, for each of the six axes
 * @property {Uint32Array[]} emission rgbe, for each of the six axes; empty without bit 0 of flags
 */

/**
 * Reads and checks the groups of a node page.
 * @param {Uint8Array} payload
 * @param {number} count groups
 * @param {{pointBytes: number, points: number, nodePages: number}} limits what the file has
 * @param {number} offset of the page in the file
 * @param {number} page its number
 * @returns {Group[]} the groups by slot
 */
export function readGroups(payload, count, limits, offset, page) {
  const view = viewOf(payload);
  const check = (good, rule, text) => need(good, `nodes.md#${rule}`, offset, text, page);
  const tableEnd = roundUp(2 * count, 8);
  check(tableEnd <= payload.length, "node-slots", "the table of slots is longer than the payload");
  check(allZero(payload, 2 * count, tableEnd), "node-zero", "a byte behind the table of slots is set");
  const groups = [];
  let at = tableEnd;
  for (let slot = 0; slot < count; slot++) {
    check(view.getUint16(2 * slot, true) * 8 === at, "node-slots", `slot ${slot} is not where its group starts`);
    check(payload.length - at >= 24, "node-slots", `the group of slot ${slot} is cut off`);
    const n = payload[at + 17];
    const flags = payload[at + 19];
    check(n >= 1 && n <= 8, "node-children", `a group has ${n} children`);
    check(flags <= (limits.pointBytes === 40 ? 1 : 0), "node-mask", `flags of a group are ${flags}`);
    const bytes = 24 + (62 + 24 * flags) * n;
    check(roundUp(bytes, 8) <= payload.length - at, "node-slots", `the group of slot ${slot} is cut off`);
    check(allZero(payload, at + bytes, at + roundUp(bytes, 8)), "node-zero", "a byte behind a group is set");
    groups.push(readGroup(payload.slice(at, at + bytes), n, flags, limits, check));
    at += roundUp(bytes, 8);
  }
  check(at === payload.length, "node-slots", "groups do not fill the payload");
  return groups;
}

/** Reads and checks one group, whose bytes have the length that its number of children needs. */
function readGroup(bytes, n, flags, limits, check) {
  const view = viewOf(bytes);
  const { nodePages, points } = limits;
  const cellHigh = big(view, 0);
  const cellLow = big(view, 8);
  const level = bytes[16];
  const interior = bytes[18];
  check(level <= 62, "node-level", `level of a group is ${level}`);
  check(cellHigh < KEY_LIMIT && cellLow < KEY_LIMIT, "node-cell", "bit 63 of a cell is set");
  const free = BigInt(3 * Math.max(0, 42 - level));
  check(((cellHigh << 63n) | cellLow) % (1n << free) === 0n, "node-cell", "a digit after the cell's level is not 0");
  check(interior >>> n === 0, "node-mask", "interior names children that do not exist");
  check(view.getUint32(20, true) === 0, "node-zero", "the reserved field of a group is set");

  // Read the references.
  const children = [];
  for (let i = 0; i < n; i++) {
    const low = view.getUint32(24 + 8 * i, true);
    const middle = view.getUint16(28 + 8 * i, true);
    const high = view.getUint16(30 + 8 * i, true);
    if ((interior >>> i) & 1) {
      check(low < nodePages, "node-reference", `node page ${low} does not exist`);
      check(high === 0, "node-zero", "a reserved bit of a reference is set");
      children.push({ page: low, slot: middle });
    } else {
      const first = middle * 2 ** 32 + low;
      check(high >= 1, "node-leaf", "a leaf has no points");
      check(first <= points - high, "node-leaf", `points ${first} to ${first + high - 1} do not all exist`);
      children.push({ first, count: high });
    }
  }

  // Read the columns; each starts a fixed number of bytes for each child after the head.
  const column = (Type, start) =>
    new Type(bytes.slice(24 + start * n, 24 + start * n + Type.BYTES_PER_ELEMENT * n).buffer);
  const columns = (Type, start, count) =>
    Array.from({ length: count }, (_, k) => column(Type, start + Type.BYTES_PER_ELEMENT * k));
  const axes = new Int8Array(bytes.slice(24 + 16 * n, 24 + 18 * n).buffer);
  const group = { cellHigh, cellLow, level, emits: flags === 1, children, mean: columns(Uint16Array, 8, 3),
    radius: column(Uint16Array, 14), coneAxis: [0, 1].map((k) => axes.filter((_, i) => i % 2 === k)),
    coneCos: column(Int16Array, 18), area: column(Uint16Array, 20), thickness: column(Uint16Array, 22),
    greatest: column(Uint16Array, 24), facing: columns(Uint16Array, 26, 6),
    radiance: columns(Uint32Array, 38, 6), emission: flags === 1 ? columns(Uint32Array, 62, 6) : [] };
  for (const numbers of [group.radius, group.area, group.thickness, group.greatest]) {
    check(numbers.every((bits) => bits < 0xff00), "node-number", "a number of a node is infinite or NaN");
  }
  return group;
}
