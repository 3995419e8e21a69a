/**
 * Checksums, the codecs of payloads (spec/container.md#codecs) and packed columns
 * (spec/points.md#packed-columns).
 */

import { decompress } from "fzstd";
import { xxhash128, xxhash3, xxhash64 } from "hash-wasm";
import { big, u64, viewOf } from "./values.js";

/**
 * Returns the XXH3-64 of bytes under a seed of 64 bits.
 * @param {Uint8Array} bytes
 * @param {bigint} [seed]
 * @returns {Promise<bigint>}
 */
export async function xxh3(bytes, seed = 0n) {
  return BigInt("0x" + (await xxhash3(bytes, Number(seed & 0xffffffffn), Number(seed >> 32n))));
}

/**
 * Returns the XXH3-128 of bytes under a seed of 64 bits as 32 hexadecimal digits, the high half first.
 * @param {Uint8Array} bytes
 * @param {bigint} [seed]
 * @returns {Promise<string>}
 */
export async function xxh3Wide(bytes, seed = 0n) {
  return xxhash128(bytes, Number(seed & 0xffffffffn), Number(seed >> 32n));
}

/** Returns the seed that a text of 8 characters stands for. */
export function textSeed(text) {
  return big(viewOf(new TextEncoder().encode(text)), 0);
}

/** Returns the seed of a page's header (spec/checksums.md#page-seed). */
export async function pageSeed(uuid, type, group, rank) {
  const bytes = new Uint8Array(22);
  bytes.set(uuid);
  viewOf(bytes).setUint32(16, rank, true);
  bytes[20] = type;
  bytes[21] = group;
  return xxh3(bytes);
}

/**
 * Decodes one zstd frame, after its header and the chain of its blocks were checked here.
 * @param {Uint8Array} stored the payload as stored
 * @param {number} least least number of decoded bytes that is in range
 * @param {number} most greatest number of decoded bytes that is in range
 * @param {(good: boolean, text: string) => void} check refuses the page unless its first argument holds
 * @returns {Promise<Uint8Array>}
 */
export async function decodeZstd(stored, least, most, check) {
  // Check the frame's header: single segment, no dictionary, a content size in range.
  const view = viewOf(stored);
  check(stored.length >= 6 && view.getUint32(0, true) === 0xfd2fb528, "the payload is not a zstd frame");
  const flags = stored[4];
  check((flags & 0x20) !== 0, "the zstd frame is not a single segment");
  check((flags & 0x08) === 0, "a reserved bit of the zstd frame's header is set");
  check((flags & 0x03) === 0, "the zstd frame names a dictionary");
  const sizeBytes = 1 << (flags >> 6);
  const start = 5 + sizeBytes;
  check(stored.length >= start, "the zstd frame ends in its header");
  const size = [() => view.getUint8(5), () => view.getUint16(5, true) + 256, () => view.getUint32(5, true),
    () => u64(view, 5)][flags >> 6]();
  check(size >= least && size <= most, `the zstd frame's content size is ${size}`);

  // Follow the blocks: the last one and the content checksum end where the payload ends.
  let at = start;
  for (let last = false; !last; ) {
    check(stored.length - at >= 3, "the zstd frame ends before its last block");
    const head = stored[at] | (stored[at + 1] << 8) | (stored[at + 2] << 16);
    const type = (head >> 1) & 3;
    const blockBytes = head >> 3;
    check(type !== 3, "a block of the zstd frame has the reserved type");
    check(blockBytes <= Math.min(size, 2 ** 17), "a block of the zstd frame is longer than its limit");
    const taken = type === 1 ? 1 : blockBytes;
    check(stored.length - at - 3 >= taken, "a block of the zstd frame is cut off");
    at += 3 + taken;
    last = (head & 1) !== 0;
  }
  const sumBytes = flags & 0x04 ? 4 : 0;
  check(stored.length - at === sumBytes, "the zstd frame does not end where the payload ends");

  // Decode the blocks under a header without content size, so that the decoder counts by itself.
  const frame = new Uint8Array(6 + at - start);
  frame.set([0x28, 0xb5, 0x2f, 0xfd, 0, 0x50]);
  frame.set(stored.subarray(start, at), 6);
  let decoded;
  try {
    decoded = decompress(frame);
  } catch (error) {
    check(false, `the zstd frame does not decode: ${error.message}`);
  }
  check(decoded.length === size, `the zstd frame decodes to ${decoded.length} bytes and says ${size}`);
  if (sumBytes) {
    const sum = Number(BigInt("0x" + (await xxhash64(decoded))) & 0xffffffffn);
    check(sum === view.getUint32(at, true), "the zstd frame's content checksum is wrong");
  }
  return decoded;
}

/**
 * Decodes a number of bytes and one LZ4 block, the end conditions of a block included.
 * @param {Uint8Array} stored the payload as stored
 * @param {number} least least number of decoded bytes that is in range
 * @param {number} most greatest number of decoded bytes that is in range
 * @param {(good: boolean, text: string) => void} check refuses the page unless its first argument holds
 * @returns {Uint8Array}
 */
export function decodeLz4(stored, least, most, check) {
  check(stored.length >= 5, "the payload is too short for an LZ4 block");
  const size = viewOf(stored).getUint32(0, true);
  check(size >= least && size <= most, `the LZ4 block's number of decoded bytes is ${size}`);
  const out = new Uint8Array(size);
  let at = 4;
  let to = 0;
  let lastMatch = -1;
  const more = (length) => {
    if (length < 15) return length;
    for (let byte = 255; byte === 255; length += byte) {
      check(at < stored.length, "the LZ4 block ends in a length");
      byte = stored[at++];
    }
    return length;
  };
  for (;;) {
    // Copy the literals of a sequence; the last sequence has nothing else.
    check(at < stored.length, "the LZ4 block ends before its last literals");
    const token = stored[at++];
    const literals = more(token >> 4);
    check(literals <= stored.length - at, "literals of the LZ4 block are cut off");
    check(literals <= size - to, "the LZ4 block decodes to more bytes than it says");
    out.set(stored.subarray(at, at + literals), to);
    at += literals;
    to += literals;
    if (at === stored.length) {
      check(to === size, `the LZ4 block decodes to ${to} bytes and says ${size}`);
      check(lastMatch < 0 || literals >= 5, "the last 5 bytes of the LZ4 block are not literals");
      check(lastMatch < 0 || lastMatch <= size - 12, "the LZ4 block's last match begins too late");
      return out;
    }

    // Copy the match, byte by byte because it may overlap what it makes.
    check(stored.length - at >= 2, "the LZ4 block ends in an offset");
    const distance = stored[at] | (stored[at + 1] << 8);
    at += 2;
    check(distance > 0 && distance <= to, "a match of the LZ4 block begins before its start");
    const length = more(token & 15) + 4;
    check(length <= size - to, "the LZ4 block decodes to more bytes than it says");
    lastMatch = to;
    for (let i = 0; i < length; i++, to++) out[to] = out[to - distance];
  }
}

/**
 * Reads one packed column of w bits, at most 48, as Numbers.
 * @param {Uint8Array} codes planes of n bytes each
 */
function narrowColumn(codes, n, w, shift, planes, base) {
  const values = new Float64Array(n);
  const modulus = 2 ** w;
  const scale = 2 ** shift;
  let value = Number(base);
  for (let i = 0; i < n; i++) {
    let code = 0;
    for (let k = planes - 1; k >= 0; k--) code = code * 256 + codes[k * n + i];
    const step = code % 2 === 0 ? code / 2 : -(code + 1) / 2;
    value = (value + ((step * scale) % modulus) + modulus) % modulus;
    values[i] = value;
  }
  return values;
}

/** Reads one packed column of 64 bits as BigInts. */
function wideColumn(codes, n, shift, planes, base) {
  const values = new BigUint64Array(n);
  let value = base;
  for (let i = 0; i < n; i++) {
    let code = 0n;
    for (let k = planes - 1; k >= 0; k--) code = (code << 8n) | BigInt(codes[k * n + i]);
    const step = (code >> 1n) ^ -(code & 1n);
    value = BigInt.asUintN(64, value + (step << BigInt(shift)));
    values[i] = value;
  }
  return values;
}

/**
 * Unpacks columns of the given widths that take all bytes.
 * @param {Uint8Array} packed
 * @param {number} n values of each column
 * @param {number[]} widths bits of the values of each column: at most 48, or 64
 * @param {(good: boolean, text: string) => void} check refuses the page unless its first argument holds
 * @returns {(Float64Array|BigUint64Array)[]} BigUint64Array for columns of 64 bits
 */
function unpackColumns(packed, n, widths, check) {
  const view = viewOf(packed);
  let at = 0;
  const columns = widths.map((w) => {
    check(packed.length - at >= 10, "a packed column's head is cut off");
    const shift = packed[at];
    const planes = packed[at + 1];
    const base = big(view, at + 2);
    check(shift < w, `a packed column of ${w} bits is shifted by ${shift}`);
    check(planes <= Math.ceil(w / 8), `a packed column of ${w} bits has ${planes} planes`);
    check(base < 2n ** BigInt(w), `the base of a packed column has more than ${w} bits`);
    at += 10;
    check(n * planes <= packed.length - at, "a packed column's planes are cut off");
    const codes = packed.subarray(at, at + n * planes);
    at += n * planes;
    return w === 64 ? wideColumn(codes, n, shift, planes, base) : narrowColumn(codes, n, w, shift, planes, base);
  });
  check(at === packed.length, "bytes are left over after the packed columns");
  return columns;
}

/**
 * Returns the payload of a point page from its packed columns.
 * @param {Uint8Array} packed
 * @param {number} n points
 * @param {number} pointBytes 34 or 40
 * @param {(good: boolean, text: string) => void} check refuses the page unless its first argument holds
 */
export function unpackPoints(packed, n, pointBytes, check) {
  const colours = pointBytes === 40 ? [16, 16, 16] : [];
  const columns = unpackColumns(packed, n,
    [42, 42, 42, 32, 16, 16, 16, 16, 16, 8, 8, 8, 8, ...colours], check);
  const payload = new Uint8Array(pointBytes * n);
  const view = viewOf(payload);
  const put16 = (start, values) => values.forEach((v, i) => view.setUint16(start + 2 * i, v, true));
  const undo = (green, differences, modulus) => differences.map((d, i) => (d + green[i]) % modulus);
  const [x, y, z, radius, u, v, radianceG, radianceR, radianceB, albedoG, albedoR, albedoB, flags] = columns;
  for (let i = 0; i < n; i++) {
    [x, y, z].forEach((axis, k) => view.setUint32(4 * (k * n + i), axis[i] % 2 ** 32, true));
    const [hx, hy, hz] = [x, y, z].map((axis) => Math.floor(axis[i] / 2 ** 32));
    view.setUint32(12 * n + 4 * i, hx | (hy << 10) | (hz << 20), true);
    view.setUint32(16 * n + 4 * i, radius[i], true);
  }
  put16(20 * n, u);
  put16(22 * n, v);
  put16(24 * n, undo(radianceG, radianceR, 2 ** 16));
  put16(26 * n, radianceG);
  put16(28 * n, undo(radianceG, radianceB, 2 ** 16));
  payload.set(undo(albedoG, albedoR, 256), 30 * n);
  payload.set(albedoG, 31 * n);
  payload.set(undo(albedoG, albedoB, 256), 32 * n);
  payload.set(flags, 33 * n);
  if (pointBytes === 40) {
    const [green, red, blue] = columns.slice(13);
    put16(34 * n, undo(green, red, 2 ** 16));
    put16(36 * n, green);
    put16(38 * n, undo(green, blue, 2 ** 16));
  }
  return payload;
}

/**
 * Returns the payload of an attribute page from its packed columns.
 * @param {Uint8Array} packed
 * @param {number} n points
 * @param {number[]} sizes bytes of the values of each column: 1, 2, 4 or 8
 * @param {(good: boolean, text: string) => void} check refuses the page unless its first argument holds
 */
export function unpackAttributes(packed, n, sizes, check) {
  const columns = unpackColumns(packed, n, sizes.map((size) => 8 * size), check);
  const payload = new Uint8Array(n * sizes.reduce((sum, size) => sum + size, 0));
  const view = viewOf(payload);
  const put = { 1: "setUint8", 2: "setUint16", 4: "setUint32", 8: "setBigUint64" };
  let at = 0;
  columns.forEach((values, k) => {
    values.forEach((value, i) => view[put[sizes[k]]](at + i * sizes[k], value, true));
    at += n * sizes[k];
  });
  return payload;
}
