/**
 * A reader of the PTCX container, version 1.0, written from the specification in the folder above.
 *
 *     | header | pages ... | directory | tail: coarse node pages, meta page | superblock A | B |
 *
 * `Container.open` is the full reader of spec/README.md#conformance: it checks header, superblocks,
 * directory and meta page before it returns. `Container.openPartial` is the partial reader: it reads
 * the last 256 KiB, and an entry of the directory only when a page is asked for. Both read from a
 * source, an object with `length` in bytes and `read(offset, length) -> Promise<Uint8Array>`. Every
 * file that breaks a rule is refused with an error of class Refused, which names rule and offset.
 * A source that gives fewer bytes than asked for is an error of class ShortRead.
 *
 * A scene of parts (spec/parts.md) reads like one file: ranks and numbers of nodes and points are the
 * scene's. Its source has a third member, `sibling(path) -> Promise<source|undefined>`, which opens a file by
 * its path from the folder of the scene, and gives undefined when there is none. The full reader opens
 * all parts at once, the partial reader each when it is first needed.
 */

import { decodeLz4, decodeZstd, pageSeed, textSeed, unpackAttributes, unpackPoints, xxh3, xxh3Wide } from "./codecs.js";
import { PART, PartList, shown } from "./parts.js";
import { readGroups, readPoints } from "./payloads.js";
import { checkBy, need, Refused } from "./rules.js";
import { attributeColumns, readSchema } from "./schema.js";
import { allZero, big, KEY_LIMIT, roundUp, sameBytes, textOf, u64, viewOf } from "./values.js";

export { Refused };

/** Numbers of the page types. */
export const NODE = 1, POINT = 2, DIRECTORY = 3, META = 4, ATTRIBUTE = 5, PARTS = 6, SKIPPABLE = 128;

/** Bytes of a block, of a sector, of a page header and of an entry of the directory. */
export const BLOCK = 4096, SECTOR = 512, PAGE_HEADER = 64, ENTRY = 40;

/** The rank of the root's page in a file without points, and the bytes that a partial reader starts with. */
const NO_PAGE = 0xffffffff, FIRST_READ = 256 * 1024;

const MAGIC = [0x89, 0x50, 0x54, 0x43, 0x0d, 0x0a, 0x1a, 0x0a];
const SUPERBLOCK_MAGIC = [...new TextEncoder().encode("PTCXSUPR")];

/** The error of a source that gives fewer bytes than the file had when it was opened. */
export class ShortRead extends Error {}

/** Reads exactly as many bytes as asked for. */
export async function readExactly(source, offset, length) {
  const bytes = await source.read(offset, length);
  if (bytes.length !== length) {
    throw new ShortRead(`${bytes.length} of ${length} bytes at offset ${offset} could be read`);
  }
  return bytes;
}

/** Says whether the frame's edge and origin keep the rules of spec/morton.md#frame. */
function frameIsSound(origin, edge) {
  const bits = new DataView(new ArrayBuffer(8));
  bits.setFloat64(0, edge);
  if (!(edge >= 2 ** -960 && edge <= 2 ** 1010) || bits.getBigUint64(0) % 2n ** 52n !== 0n) return false;
  const units = origin.map((value) => value / (edge / 2 ** 42));
  return units.every((value) => Number.isInteger(value) && value >= -(2 ** 53) && value <= 2 ** 53 - 2 ** 42);
}

/**
 * Checks bytes 8 to 119 of the file header, or of a superblock, which repeats them at the same place.
 * @param {Uint8Array} block
 * @param {number} place offset of the block in the file
 */
function readHeaderFields(block, place) {
  const view = viewOf(block);
  const check = (good, rule, at, text) => need(good, `container.md#${rule}`, place + at, text);
  const major = view.getUint16(8, true);
  const incompatible = big(view, 16);
  check(major === 1, "header-version", 8, `the major version is ${major}, and this reader knows 1`);
  check((incompatible & 1n) === 1n, "header-draft", 16, "the file is a draft of before version 1.0");
  check((incompatible & ~3n) === 0n, "header-features", 16,
    `feature_incompat 0x${incompatible.toString(16)} has a bit that this reader does not know`);
  check(view.getUint32(12, true) === BLOCK, "header-constants", 12, "header_bytes is not 4096");
  check(block[57] === 9, "header-constants", 57, "align_shift is not 9");
  check(view.getUint16(58, true) === 1, "header-constants", 58, "checksum is not 1");
  check(view.getUint32(60, true) === 0x01020304, "header-constants", 60, "byte_order is not 0x01020304");
  check(block[56] >= 12 && block[56] <= 20, "header-page-shift", 56, `page_shift is ${block[56]}`);
  check(block[96] === 34 || block[96] === 40, "header-point-bytes", 96, `point_bytes is ${block[96]}`);
  const origin = [64, 72, 80].map((at) => view.getFloat64(at, true));
  const edge = view.getFloat64(88, true);
  check(frameIsSound(origin, edge), "header-frame", 64, "the frame is not exact in doubles");
  check(allZero(block, 97, 120), "header-zero", 97, "a reserved byte of the header is set");
  return { major, minor: view.getUint16(10, true), uuid: block.slice(40, 56), pageSize: 2 ** block[56],
    pointBytes: block[96], origin, edge, unit: edge / 2 ** 42, hasParts: (incompatible & 2n) === 2n,
    readOnlyFeatures: big(view, 24), compatibleFeatures: big(view, 32) };
}

/** Reads the file header and checks it by every rule. */
async function readHeader(source) {
  const head = await readExactly(source, 0, Math.min(source.length, BLOCK));
  const check = (good, rule, at, text) => need(good, `container.md#${rule}`, at, text);
  check(sameBytes(head.subarray(0, 8), MAGIC), "header-magic", 0, "the file is not a PTCX file");
  check(head.length === BLOCK, "header-length", head.length, "the file ends in its header");
  const sum = await xxh3(head.subarray(0, 120), textSeed("PTCXHEAD"));
  check(sum === big(viewOf(head), 120), "header-checksum", 120, "the header's checksum is wrong");
  const fields = readHeaderFields(head, 0);
  check(allZero(head, 128), "header-zero", 128, "a reserved byte of the header is set");
  return { ...fields, bytes: head };
}

/** Reads the block at an offset and says whether it is a superblock; undefined outside the file. */
async function lookAtSuperblock(source, offset) {
  if (offset < 0) return undefined;
  const bytes = await readExactly(source, offset, BLOCK);
  const magic = sameBytes(bytes.subarray(0, 8), SUPERBLOCK_MAGIC);
  const sum = await xxh3(bytes.subarray(0, 4088), textSeed("PTCXSUPR"));
  return { offset, bytes, magic, whole: magic && sum === big(viewOf(bytes), 4088) };
}

/** Refuses a file whose last two blocks are no superblocks, after a look for one before them. */
async function refuseWithoutSuperblock(source, copies) {
  const first = roundUp(Math.max(source.length - 2 * BLOCK, 0), BLOCK) - BLOCK;
  for (let offset = first; offset >= BLOCK && offset > first - 256 * BLOCK; offset -= BLOCK) {
    const found = await lookAtSuperblock(source, offset);
    if (found.whole) {
      const bytes = u64(viewOf(found.bytes), 120);
      throw new Refused("container.md#superblock-length", offset,
        `the file has ${source.length} bytes, ${source.length - bytes} more than its superblock says`);
    }
  }
  const marked = copies.find((copy) => copy?.magic);
  if (marked) {
    throw new Refused("container.md#superblock-checksum", marked.offset, "the superblock's checksum is wrong");
  }
  throw new Refused("container.md#superblock-magic", Math.max(source.length - BLOCK, 0),
    "the file does not end in a superblock: it is unfinished or truncated");
}

/**
 * Reads both superblocks and chooses one as spec/container.md#superblock-copies says.
 * @returns {Promise<{chosen: {offset: number, bytes: Uint8Array}, damaged: object[]}>} `damaged` holds the
 *   copies that are not whole
 */
async function chooseSuperblock(source) {
  const a = await lookAtSuperblock(source, source.length - 2 * BLOCK);
  const b = await lookAtSuperblock(source, source.length - BLOCK);
  if (!a?.whole && !b?.whole) await refuseWithoutSuperblock(source, [b, a]);
  if (a?.whole && b?.whole) {
    need(sameBytes(a.bytes, b.bytes), "container.md#superblock-copies", a.offset, "the two superblocks differ");
  }
  return { chosen: b?.whole ? b : a, damaged: [a, b].filter((copy) => !copy.whole) };
}

/** Reads the superblock's own fields and checks what can be checked without the directory. */
function readSuperblock({ bytes, offset }, length, header) {
  const view = viewOf(bytes);
  const check = (good, rule, at, text) => need(good, `container.md#superblock-${rule}`, offset + at, text);
  const f64 = (at) => view.getFloat64(at, true);
  const vector = (at) => [f64(at), f64(at + 8), f64(at + 16)];
  const s = {
    offset, fileBytes: u64(view, 120), pageCount: view.getUint32(128, true),
    directoryPages: view.getUint32(132, true), directoryOffset: u64(view, 136), directoryHash: big(view, 144),
    pointPages: view.getUint32(152, true), nodePages: view.getUint32(156, true),
    rootPage: view.getUint32(160, true), rootSlot: view.getUint16(164, true), levels: view.getUint16(166, true),
    attributeGroups: view.getUint16(168, true), leafPoints: view.getUint32(172, true), points: u64(view, 176),
    nodes: u64(view, 184), nodeGroups: u64(view, 192), tailOffset: u64(view, 200),
    tailPages: view.getUint16(208, true), boundsLow: vector(232), boundsHigh: vector(256), area: f64(280),
    flux: vector(288), tail: bytes.subarray(512, 3072), hash: big(view, 4088),
    digest: [big(view, 320), big(view, 312)].map((half) => half.toString(16).padStart(16, "0")).join(""),
  };

  // Check the length of the file, and what the directory and the pages take of it.
  check(s.fileBytes === length && length % BLOCK === 0, "length", 120,
    `the file has ${length} bytes, and the superblock says ${s.fileBytes}`);
  const fullPage = Math.floor((header.pageSize - PAGE_HEADER) / ENTRY);
  check(s.pageCount >= 1 && s.pageCount <= 2 ** 32 - 2 &&
    s.pageCount >= (1 + s.attributeGroups) * s.pointPages + s.nodePages + 1, "pages", 128,
    `page_count is ${s.pageCount}`);
  check(s.directoryPages === Math.ceil(s.pageCount / fullPage), "pages", 132,
    `directory_pages is ${s.directoryPages} for ${s.pageCount} pages`);
  const lastEntries = s.pageCount - (s.directoryPages - 1) * fullPage;
  const directoryBytes = (s.directoryPages - 1) * header.pageSize +
    roundUp(PAGE_HEADER + ENTRY * lastEntries, BLOCK);
  for (const [at, place] of [[136, s.directoryOffset], [200, s.tailOffset]]) {
    check(place >= BLOCK && place % BLOCK === 0 && place <= length - 2 * BLOCK, "pages", at,
      `the directory starts or ends at offset ${place}`);
  }
  check(s.directoryOffset + directoryBytes === s.tailOffset, "pages", 200,
    "the directory does not end where the tail starts");

  // Check counts and root.
  const limit = 2 ** 48;
  const counts = [s.points, s.nodes, s.nodeGroups];
  check(s.points <= limit && s.nodes <= limit && s.nodeGroups <= s.nodes && s.nodes <= 8 * s.nodeGroups,
    "counts", 176, `${s.points} points, ${s.nodes} nodes and ${s.nodeGroups} groups contradict each other`);
  check(counts.every((n) => n === 0) || counts.every((n) => n > 0), "counts", 176,
    "some of points, nodes and groups are zero, and not all");
  check(s.leafPoints <= 65535 && (s.leafPoints > 0 || s.points === 0), "counts", 172,
    `leaf_points is ${s.leafPoints}`);
  check(s.attributeGroups <= 255, "counts", 168, `attribute_groups is ${s.attributeGroups}`);
  if (s.points === 0) {
    check(s.rootPage === NO_PAGE && s.rootSlot === 0 && s.levels === 0, "root", 160,
      "a file without points has a root");
  } else {
    check(s.rootPage < s.nodePages, "root", 160, `root_page ${s.rootPage} does not exist`);
    check(s.levels >= 1 && s.levels <= 63, "root", 166, `levels is ${s.levels}`);
  }

  // Check totals, the writer's name and the reserved bytes.
  const ordered = s.boundsLow.every((low, k) => Number.isFinite(low) && Number.isFinite(s.boundsHigh[k]) &&
    low <= s.boundsHigh[k]);
  check(ordered, "totals", 232, "the bounds are infinite, NaN or out of order");
  check([s.area, ...s.flux].every((value) => Number.isFinite(value) && value >= 0), "totals", 280,
    "area or flux is infinite, NaN or negative");
  const end = bytes.subarray(328, 392).indexOf(0);
  s.writer = end < 0 ? undefined : textOf(bytes.subarray(328, 328 + end));
  check(s.writer !== undefined && allZero(bytes, 328 + end, 392), "writer", 328,
    "the writer is not text of at most 63 bytes, followed by zeros");
  for (const [from, to] of [[170, 172], [210, 232], [392, 512], [3072, 4088]]) {
    check(allZero(bytes, from, to), "zero", from, "a reserved byte of the superblock is set");
  }
  need(s.tailPages >= 1 && s.tailPages <= 64 && s.tailPages <= s.pageCount, "container.md#tail-pages",
    offset + 208, `tail_pages is ${s.tailPages}`);
  need(allZero(s.tail, ENTRY * s.tailPages), "container.md#tail-pages", offset + 512 + ENTRY * s.tailPages,
    "bytes behind the entries of the tail are set");
  return s;
}

/**
 * An entry of the directory.
 * @typedef {object} Entry
 * @property {number} offset of the page in the file; 0 when the page is void
 * @property {number} storedBytes
 * @property {number} rawBytes
 * @property {bigint} payloadHash
 * @property {bigint} firstKey
 * @property {number} recordCount
 * @property {number} type
 * @property {number} group
 * @property {number} level
 */

/** Returns the entry at an offset of bytes of the directory, unchecked. */
function decodeEntry(bytes, at) {
  const view = viewOf(bytes);
  return { offset: u64(view, at), storedBytes: view.getUint32(at + 8, true),
    rawBytes: view.getUint32(at + 12, true), payloadHash: big(view, at + 16), firstKey: big(view, at + 24),
    recordCount: view.getUint32(at + 32, true), type: bytes[at + 36], group: bytes[at + 37],
    level: bytes[at + 38], reserved: bytes[at + 39] };
}

/** Returns the fields of a page header, unchecked. */
function decodePageHeader(head) {
  const view = viewOf(head);
  return { type: head[4], group: head[5], codec: head[6], filter: head[7], rank: view.getUint32(8, true),
    storedBytes: view.getUint32(12, true), rawBytes: view.getUint32(16, true),
    recordCount: view.getUint32(20, true), level: head[24], firstKey: big(view, 32), lastKey: big(view, 40),
    payloadHash: big(view, 48), headerHash: big(view, 56) };
}

/** Says whether an entry is that of a void attribute page, which the file does not hold. */
export function isVoid(entry) {
  return entry.type === ATTRIBUTE && entry.offset === 0 && entry.storedBytes === 0 &&
    entry.rawBytes === 0 && entry.payloadHash === 0n;
}

/** Returns how many bytes of the file a page takes, rounded up to sectors. */
export function extentOf(entry) {
  return roundUp(PAGE_HEADER + entry.storedBytes, SECTOR);
}

/** Refuses a part that is a scene of parts itself, before anything of it is opened. */
function refuseNested(header, asPart) {
  need(!(asPart && header.hasParts), "parts.md#parts-file", 16, "a part is a scene of parts itself");
}

/** Returns what a function returns; an error of it names the file of a part. */
export async function inFile(name, work) {
  try {
    return await work();
  } catch (error) {
    if (error instanceof Refused) error.file ??= shown(name);
    throw error;
  }
}

/** Returns the channels of a schema as a text, which is the same for equal channels. */
function channelText({ channels }) {
  return JSON.stringify(channels, (_, value) => (typeof value === "bigint" ? String(value) : value));
}

/** An open container; made by `Container.open` or `Container.openPartial`. */
export class Container {
  /** Takes what both readers know before they read the directory. */
  constructor(source, header, superblock, damaged) {
    this.source = source;
    this.header = header;
    this.superblock = superblock;
    /** The superblocks that are not whole, with `offset` and `magic`; the reader goes on with the other one. */
    this.damaged = damaged;
    this.entriesPerPage = Math.floor((header.pageSize - PAGE_HEADER) / ENTRY);
    const fit = Math.floor((header.pageSize - PAGE_HEADER) / header.pointBytes);
    this.pointsPerPage = fit - (fit % 8);
    this.nodesStart = (1 + superblock.attributeGroups) * superblock.pointPages;
    this.nodesEnd = this.nodesStart + superblock.nodePages;
    /** Number of the first page of each skippable type. */
    this.skippable = new Map();
    /** The channel group of each block of attribute pages, as far as the directory was read. */
    this.groups = [];
    /** All entries, concatenated; undefined in a partial reader. */
    this.directory = undefined;
    /** Channels, groups and texts of the meta page. */
    this.schema = undefined;
    /** The parts of a scene of parts; undefined in any other file. @type {PartList|undefined} */
    this.parts = undefined;
    /** The containers of the parts that were opened, by number. */
    this.opened = [];
  }

  /**
   * Opens a file as a full reader.
   * @param {object} source
   * @param {boolean} [asPart] whether the file is a part of a scene, which has no parts of its own
   */
  static async open(source, asPart = false) {
    const container = await Container.openSuperblock(source, asPart);
    await container.readDirectory();
    await container.readMeta();
    await container.readParts();
    await container.openParts();
    return container;
  }

  /** Reads header and superblocks of a file, and neither directory nor meta page. */
  static async openSuperblock(source, asPart = false) {
    const header = await readHeader(source);
    refuseNested(header, asPart);
    const { chosen, damaged } = await chooseSuperblock(source);
    need(sameBytes(chosen.bytes.subarray(8, 120), header.bytes.subarray(8, 120)),
      "container.md#superblock-header", chosen.offset + 8, "the superblock repeats another file header");
    const superblock = readSuperblock(chosen, source.length, header);
    return new Container(source, header, superblock, damaged);
  }

  /** Opens a file as a partial reader, which leaves out header, other superblock and directory. */
  static async openPartial(source, asPart = false) {
    const start = Math.max(0, source.length - FIRST_READ);
    const end = await readExactly(source, start, source.length - start);
    const cached = { length: source.length,
      read: async (offset, length) => offset >= start && offset + length <= source.length
        ? end.subarray(offset - start, offset - start + length) : source.read(offset, length),
      sibling: source.sibling };
    need(source.length >= 2 * BLOCK, "container.md#superblock-magic", 0, "the file is too short for superblocks");
    const { chosen, damaged } = await chooseSuperblock(cached);
    const header = readHeaderFields(chosen.bytes, chosen.offset);
    refuseNested(header, asPart);
    const superblock = readSuperblock(chosen, source.length, header);
    const container = new Container(cached, header, superblock, damaged);
    container.checkTail();
    await container.readMeta();
    await container.readParts();
    return container;
  }

  /** Returns the place of entry n in the file. */
  entryOffset(n) {
    return this.superblock.directoryOffset + Math.floor(n / this.entriesPerPage) * this.header.pageSize +
      PAGE_HEADER + ENTRY * (n % this.entriesPerPage);
  }

  /**
   * Returns type, group and rank of page n (spec/container.md#pages). The type of a skippable page is
   * taken from its entry, and its rank counts from the first page of this type that the reader met.
   */
  placeOf(n, entry) {
    const { pointPages, pageCount } = this.superblock;
    if (n < pointPages) return { type: POINT, group: 0, rank: n };
    if (n < this.nodesStart) {
      const block = Math.floor(n / pointPages) - 1;
      return { type: ATTRIBUTE, group: this.groups[block] ?? entry.group, rank: n % pointPages };
    }
    if (n < this.nodesEnd) return { type: NODE, group: 0, rank: n - this.nodesStart };
    if (n === pageCount - 1) return { type: META, group: 0, rank: 0 };
    if (entry.type === PARTS) return { type: PARTS, group: 0, rank: n - this.nodesEnd };
    return { type: entry.type, group: 0, rank: n - (this.skippable.get(entry.type) ?? n) };
  }

  /** Returns entry n; a partial reader reads it from the tail or from its place, and checks it. */
  async entry(n) {
    if (this.directory) return decodeEntry(this.directory, ENTRY * n);
    const { pageCount, tailPages, tail } = this.superblock;
    const inTail = n - (pageCount - tailPages);
    if (inTail >= 0) return decodeEntry(tail, ENTRY * inTail);
    const entry = decodeEntry(await readExactly(this.source, this.entryOffset(n), ENTRY), 0);
    this.checkEntry(n, entry);
    this.checkPointEntry(n, entry);
    this.checkAttributeEntry(n, entry);
    return entry;
  }

  /** Checks what a page header and an entry have in common, by the rules of pages. */
  checkPageFields(fields, offset, page) {
    const check = (good, rule, text) => need(good, `container.md#${rule}`, offset, text, page);
    const { type, group, level, recordCount, rawBytes, storedBytes } = fields;
    check((type >= NODE && type <= PARTS) || type >= SKIPPABLE, "page-type", `page type ${type} is unknown`);
    const most = this.header.pageSize - PAGE_HEADER;
    check(rawBytes >= 1 && rawBytes <= most, "page-length", `raw_bytes is ${rawBytes}`);
    check(storedBytes >= 1 && storedBytes <= rawBytes, "page-length", `stored_bytes is ${storedBytes}`);
    this.checkRecords(fields, check);
    check(level === 255 || type === NODE, "page-fields", `level is ${level}`);
    check(level <= 62 || type !== NODE, "page-fields", `level of a node page is ${level}`);
    check(type === ATTRIBUTE ? group > 0 : group === 0, "page-fields", `group is ${group}`);
    const recordBytes = { [POINT]: this.header.pointBytes, [DIRECTORY]: ENTRY, [PARTS]: PART }[type];
    check(recordBytes === undefined || rawBytes === recordBytes * recordCount, "page-fields",
      `${recordCount} records do not take ${rawBytes} bytes`);
  }

  /** Checks number of records and keys, which an entry of a void page has as well. */
  checkRecords({ type, recordCount, firstKey, lastKey = firstKey, reserved = 0 }, check) {
    const most = type === NODE ? 65535 : type === META ? 1 : 2 ** 32 - 1;
    check(recordCount >= 1 && recordCount <= most, "page-fields", `record_count is ${recordCount}`);
    check(reserved === 0, "page-fields", "the reserved field is set");
    check(firstKey <= lastKey && lastKey < KEY_LIMIT, "page-keys", "the keys of a page are out of order or range");
    check([NODE, POINT, PARTS].includes(type) || lastKey === 0n, "page-keys", "a page without keys has a key");
  }

  /** Checks entry n by itself: rules of pages, extent, and the type and group of its place. */
  checkEntry(n, entry) {
    const place = this.placeOf(n, entry);
    const offset = this.entryOffset(n);
    const check = (good, rule, text) => need(good, `container.md#${rule}`, offset, text, n);
    const known = (entry.type >= NODE && entry.type <= PARTS) || entry.type >= SKIPPABLE;
    const isMeta = n === this.superblock.pageCount - 1;
    check(known, "page-type", `page type ${entry.type} is unknown`);
    check(!isMeta || entry.type === META, "meta-page", "the last page is not of type meta");
    const behindNodes = n >= this.nodesEnd && !isMeta;
    const mayStandThere = entry.type >= SKIPPABLE || (entry.type === PARTS && this.header.hasParts);
    check(behindNodes ? mayStandThere : entry.type === place.type, "directory-listing",
      `page type ${entry.type} is not that of the page's place`);
    check(entry.group === place.group || entry.type !== ATTRIBUTE, "directory-listing",
      `group ${entry.group} is not that of the page's place`);
    if (isVoid(entry)) {
      this.checkRecords(entry, check);
      check(entry.level === 255 && entry.group > 0, "page-fields", "level or group of a void page is out of range");
      return;
    }
    this.checkPageFields(entry, offset, n);
    check(entry.reserved === 0, "page-fields", "the reserved field of the entry is set");
    const end = this.superblock.fileBytes - 2 * BLOCK;
    check(entry.offset % SECTOR === 0 && entry.offset >= BLOCK && entry.offset <= end &&
      extentOf(entry) <= end - entry.offset, "directory-extent", `offset ${entry.offset} is outside the pages`);
  }

  /** Checks that a point page holds as many points as its rank says. */
  checkPointEntry(n, entry) {
    if (entry.type !== POINT) return;
    need(entry.recordCount === this.pointsOf(n), "points.md#point-pages", this.entryOffset(n),
      `the page has ${entry.recordCount} points, and ${this.pointsOf(n)} belong there`, n);
  }

  /** Returns how many points the point page of a rank holds. */
  pointsOf(rank) {
    return Math.min(this.pointsPerPage, this.superblock.points - rank * this.pointsPerPage);
  }

  /** Checks an attribute page's entry against point pages and schema. */
  checkAttributeEntry(n, entry) {
    if (entry.type !== ATTRIBUTE) return;
    const check = checkBy("points.md#attribute-pages", this.entryOffset(n), n);
    const { pointPages } = this.superblock;
    const rank = n % pointPages;
    const group = this.schema.groups[Math.floor(n / pointPages) - 1];
    check(entry.group === group, `the page is of group ${entry.group}, and the schema has ${group} at this place`);
    check(entry.recordCount === this.pointsOf(rank), `the page has values of ${entry.recordCount} points`);
    const bytes = entry.recordCount * this.channelsOf(entry.group).reduce((sum, c) => sum + c.components * c.size, 0);
    check(isVoid(entry) || entry.rawBytes === bytes, `the page has ${entry.rawBytes} bytes and not ${bytes}`);
  }

  /** Returns the channels of a group. */
  channelsOf(group) {
    return this.schema.channels.filter((channel) => channel.group === group);
  }

  /** Reads and checks the whole directory. */
  async readDirectory() {
    const s = this.superblock;
    const all = new Uint8Array(ENTRY * s.pageCount);
    const rule = "container.md#directory-pages";
    for (let rank = 0; rank < s.directoryPages; rank++) {
      const offset = s.directoryOffset + rank * this.header.pageSize;
      const count = Math.min(this.entriesPerPage, s.pageCount - rank * this.entriesPerPage);
      const head = await this.pageHeader(offset, { type: DIRECTORY, group: 0, rank });
      need(head.recordCount === count, rule, offset, `directory page ${rank} has not ${count} entries`);
      const payload = await readExactly(this.source, offset + PAGE_HEADER, ENTRY * count);
      need((await xxh3(payload)) === head.payloadHash, rule, offset, "a directory page's checksum is wrong");
      all.set(payload, ENTRY * rank * this.entriesPerPage);
    }
    need((await xxh3(all)) === s.directoryHash, rule, s.directoryOffset, "directory_xxh3 is not that of the entries");
    this.directory = all;
    await this.checkEntries();
    this.checkOverlap();
    this.checkTail();
    await this.checkCounts();
  }

  /** Checks every entry in the order of the pages' numbers. */
  async checkEntries() {
    const s = this.superblock;
    let typeBefore = PARTS;
    for (let n = 0; n < s.pageCount; n++) {
      const entry = await this.entry(n);
      if (n >= s.pointPages && n < this.nodesStart && n % s.pointPages === 0) {
        need(entry.group > (this.groups.at(-1) ?? 0) || entry.type !== ATTRIBUTE, "container.md#directory-listing",
          this.entryOffset(n), "channel groups of attribute pages do not ascend", n);
        this.groups.push(entry.group);
      }
      if (n >= this.nodesEnd && n < s.pageCount - 1) {
        if (!this.skippable.has(entry.type)) this.skippable.set(entry.type, n);
        this.checkEntry(n, entry);
        need(entry.type >= typeBefore, "container.md#directory-listing", this.entryOffset(n),
          "types of pages behind the node pages descend", n);
        typeBefore = entry.type;
        await this.pageHeader(entry.offset, this.placeOf(n, entry), n, entry);
      } else {
        this.checkEntry(n, entry);
      }
    }
  }

  /** Checks that no two pages overlap, and that none overlaps the directory. */
  checkOverlap() {
    const s = this.superblock;
    const extents = [{ from: s.directoryOffset, to: s.tailOffset }];
    for (let n = 0; n < s.pageCount; n++) {
      const entry = decodeEntry(this.directory, ENTRY * n);
      if (!isVoid(entry)) extents.push({ from: entry.offset, to: entry.offset + extentOf(entry), page: n });
    }
    extents.sort((a, b) => a.from - b.from);
    for (let i = 1; i < extents.length; i++) {
      need(extents[i].from >= extents[i - 1].to, "container.md#directory-overlap", extents[i].from,
        "a page overlaps another one or the directory", extents[i].page ?? extents[i - 1].page);
    }
  }

  /** Checks that the tail is the last pages of the directory, and that the superblock repeats their entries. */
  checkTail() {
    const s = this.superblock;
    const first = s.pageCount - s.tailPages;
    let place = s.tailOffset;
    for (let i = 0; i < s.tailPages; i++) {
      const at = s.offset + 512 + ENTRY * i;
      const entry = decodeEntry(s.tail, ENTRY * i);
      const check = checkBy("container.md#tail-pages", at, first + i);
      if (this.directory) {
        const own = this.directory.subarray(ENTRY * (first + i), ENTRY * (first + i + 1));
        check(sameBytes(own, s.tail.subarray(ENTRY * i, ENTRY * (i + 1))), "the superblock lists another entry");
      } else {
        this.checkEntry(first + i, entry);
      }
      check(entry.type !== POINT && entry.type !== ATTRIBUTE, "a page of points or attributes lies in the tail");
      check(entry.offset === place, `a page of the tail is at ${entry.offset} and not at ${place}`);
      place += extentOf(entry);
    }
    need(roundUp(place, BLOCK) === s.fileBytes - 2 * BLOCK, "container.md#tail-pages", place,
      "the tail does not end where superblock A starts");
  }

  /** Checks counts, root, digest and the numbers of points of pages against the directory. */
  async checkCounts() {
    const s = this.superblock;
    const check = (good, rule, at, text) => need(good, `container.md#superblock-${rule}`, s.offset + at, text);
    if (!this.header.hasParts) {
      const groups = await this.ownGroups();
      check(groups === s.nodeGroups, "counts", 192, `the directory has ${groups} groups, not ${s.nodeGroups}`);
      let points = 0;
      for (let n = 0; n < s.pointPages; n++) points += (await this.entry(n)).recordCount;
      check(points === s.points, "counts", 176, `the directory has ${points} points, not ${s.points}`);
    }
    if (s.points > 0) {
      const root = await this.entry(this.nodesStart + s.rootPage);
      check(s.rootSlot < root.recordCount, "root", 164, `root_slot ${s.rootSlot} does not exist`);
    }
    const records = new Uint8Array(16 * s.pageCount);
    for (let n = 0; n < s.pageCount; n++) {
      const from = ENTRY * n;
      records.set(this.directory.subarray(from + 36, from + 38), 16 * n);
      records.set(this.directory.subarray(from + 32, from + 36), 16 * n + 4);
      records.set(this.directory.subarray(from + 16, from + 24), 16 * n + 8);
    }
    check((await xxh3Wide(records)) === s.digest, "digest", 312, "the content digest is not the directory's");
    if (this.header.hasParts) return;
    need(s.pointPages === Math.ceil(s.points / this.pointsPerPage), "points.md#point-pages", s.offset + 152,
      `${s.points} points do not take ${s.pointPages} pages`);
    for (let n = 0; n < s.pointPages; n++) this.checkPointEntry(n, await this.entry(n));
  }

  /** Returns the number of groups on the node pages of this file, without those of its parts. */
  async ownGroups() {
    let groups = 0;
    for (let n = this.nodesStart; n < this.nodesEnd; n++) groups += (await this.entry(n)).recordCount;
    return groups;
  }

  /** Reads the records of a scene of parts and checks them. */
  async readParts() {
    if (!this.header.hasParts) return;
    const s = this.superblock;
    const full = Math.floor((this.header.pageSize - PAGE_HEADER) / PART);
    const parts = new PartList(s.nodePages);
    let last = full;
    for (let n = this.nodesEnd; n < s.pageCount - 1; n++) {
      const entry = await this.entry(n);
      if (entry.type !== PARTS) break;
      need(last === full, "parts.md#parts-page", this.entryOffset(n - 1), "a parts page is not full", n - 1);
      parts.add(await this.payload(n), entry.offset + PAGE_HEADER, n);
      last = entry.recordCount;
    }
    need(parts.records.length > 0 && s.pointPages === 0, "parts.md#parts-page", s.offset,
      "a scene of parts has no part, or points of its own");
    need(parts.points === s.points, "parts.md#parts-count", s.offset + 176,
      `the parts have ${parts.points} points, and the superblock says ${s.points}`);
    this.parts = parts;
  }

  /** Opens all parts of a scene, and checks what they have together. */
  async openParts() {
    if (!this.parts) return;
    const s = this.superblock;
    let groups = await this.ownGroups();
    for (let i = 0; i < this.parts.records.length; i++) groups += (await this.part(i)).superblock.nodeGroups;
    need(groups === s.nodeGroups, "container.md#superblock-counts", s.offset + 192,
      `scene and parts have ${groups} groups, and the superblock says ${s.nodeGroups}`);
  }

  /** Returns the container of a part, which is opened when it is first asked for. */
  async part(i) {
    const record = this.parts.records[i];
    this.opened[i] ??= await inFile(record.name, async () => {
      const source = await this.source.sibling(record.name);
      need(source !== undefined, "parts.md#parts-file", 0, "there is no such part");
      const part = await (this.directory ? Container.open(source, true) : Container.openPartial(source, true));
      await this.checkPart(part, record);
      return part;
    });
    return this.opened[i];
  }

  /** Checks that a part is the one that its record names, and that it suits the scene. */
  async checkPart(part, record) {
    const check = (good, text) => need(good, "parts.md#parts-file", 0, `the part has another ${text}`);
    const { header, superblock: s } = part;
    check(sameBytes(header.uuid, record.uuid), "uuid");
    check(s.fileBytes === record.fileBytes, "length");
    check(s.hash === record.superblockHash, "superblock");
    check(s.points === record.points, "number of points");
    check(s.nodePages === record.nodePages, "number of node pages");
    const keyOf = async (n) => part.pageHeader((await part.entry(n)).offset, { type: POINT, group: 0, rank: n }, n,
      await part.entry(n));
    check((await keyOf(0)).firstKey === record.firstKey >> 63n, "first key");
    check((await keyOf(s.pointPages - 1)).lastKey === record.lastKey >> 63n, "last key");
    check(header.edge === this.header.edge && header.origin.every((x, k) => x === this.header.origin[k]), "frame");
    check(header.pageSize === this.header.pageSize, "page size");
    check(header.pointBytes === this.header.pointBytes, "point_bytes");
    check(s.leafPoints === this.superblock.leafPoints, "leaf_points");
    check(channelText(part.schema) === channelText(this.schema), "schema");
  }

  /** The number of point pages of the file, or of all parts of a scene. */
  get pointPages() {
    return this.parts ? this.parts.pointPages(this.pointsPerPage) : this.superblock.pointPages;
  }

  /** The number of node pages of the file, and of all parts of a scene. */
  get nodePages() {
    return this.parts ? this.parts.nodePages : this.superblock.nodePages;
  }

  /** Reads the meta page and checks the attribute pages' entries as far as the reader has them. */
  async readMeta() {
    const s = this.superblock;
    const n = s.pageCount - 1;
    const payload = await this.payload(n);
    const place = (await this.entry(n)).offset + PAGE_HEADER;
    this.schema = readSchema(payload, place, this.header.pointBytes);
    const { groups } = this.schema;
    need(groups.length === s.attributeGroups, "points.md#attribute-pages", s.offset + 168,
      `the schema has ${groups.length} channel groups, and the superblock says ${s.attributeGroups}`);
    if (!this.directory) return;
    for (let k = s.pointPages; k < this.nodesStart; k++) this.checkAttributeEntry(k, await this.entry(k));
  }

  /**
   * Reads the header of a page and checks it.
   * @param {number} offset of the page
   * @param {{type: number, group: number, rank: number}} place what belongs there
   * @param {number} [page] number of the page; undefined for directory pages
   * @param {Entry} [entry] the entry that the header must agree with
   */
  async pageHeader(offset, place, page, entry) {
    const bytes = await readExactly(this.source, offset, PAGE_HEADER);
    const head = decodePageHeader(bytes);
    const check = (good, rule, text) => need(good, `container.md#${rule}`, offset, text, page);
    check(viewOf(bytes).getUint32(0, true) === 0x70435450, "page-magic", "no page starts here");
    const seed = await pageSeed(this.header.uuid, head.type, head.group, head.rank);
    check((await xxh3(bytes.subarray(0, 56), seed)) === head.headerHash, "page-checksum",
      "the page header was changed, or is that of another file");
    check(head.codec <= 2 && (head.codec === 0 || head.type !== DIRECTORY), "page-codec",
      `codec ${head.codec} is unknown or not allowed here`);
    const packs = (head.type === POINT || head.type === ATTRIBUTE) && head.codec !== 0;
    check(head.filter === 0 || (head.filter === 1 && packs), "page-filter",
      `filter ${head.filter} is unknown or not allowed here`);
    this.checkPageFields(head, offset, page);
    const whole = head.storedBytes === head.rawBytes;
    check(whole === (head.codec === 0), "page-length", "stored_bytes does not suit the codec");
    check(allZero(bytes, 25, 32), "page-fields", "the reserved field of the page header is set");
    check(["type", "group", "rank"].every((key) => head[key] === place[key]),
      place.type === DIRECTORY ? "directory-pages" : "page-agreement", "the page is not the one that belongs here");
    const agrees = !entry || ["storedBytes", "rawBytes", "payloadHash", "firstKey", "recordCount", "level"]
      .every((key) => head[key] === entry[key]);
    check(agrees, "page-agreement", "page header and directory differ");
    return head;
  }

  /** Reads a page's payload as it is stored, and checks its hash. */
  async storedPayload(n, entry, head) {
    const stored = await readExactly(this.source, entry.offset + PAGE_HEADER, head.storedBytes);
    need((await xxh3(stored)) === head.payloadHash, "container.md#page-payload", entry.offset,
      "the payload's checksum is wrong", n);
    return stored;
  }

  /**
   * Loads page n and returns its decoded payload; null when the page is void.
   * @param {number} n number of the page
   * @returns {Promise<Uint8Array|null>}
   */
  async payload(n) {
    const entry = await this.entry(n);
    if (isVoid(entry)) return null;
    const place = this.placeOf(n, entry);
    const head = await this.pageHeader(entry.offset, place, n, entry);
    const stored = await this.storedPayload(n, entry, head);
    if (head.codec === 0) return stored;
    const least = head.filter === 1 ? 1 : head.rawBytes;
    const decoded = head.codec === 1
      ? await decodeZstd(stored, least, head.rawBytes, checkBy("container.md#codec-frame", entry.offset, n))
      : decodeLz4(stored, least, head.rawBytes, checkBy("container.md#codec-block", entry.offset, n));
    if (head.filter === 0) return decoded;
    const check = checkBy("points.md#packed-columns", entry.offset, n);
    if (place.type === POINT) return unpackPoints(decoded, head.recordCount, this.header.pointBytes, check);
    const sizes = this.channelsOf(place.group).flatMap((c) => new Array(c.components).fill(c.size));
    return unpackAttributes(decoded, head.recordCount, sizes, check);
  }

  /**
   * Loads the point page of a rank.
   * @returns {Promise<import("./payloads.js").Points>}
   */
  async points(rank) {
    if (this.parts) {
      const place = this.parts.ofPointPage(rank, this.pointsPerPage);
      const part = await this.part(place.part);
      return inFile(this.parts.records[place.part].name, () => part.points(place.rank));
    }
    const payload = await this.payload(rank);
    return readPoints(payload, this.header.pointBytes, (await this.entry(rank)).offset, rank);
  }

  /** Loads the attribute page of a rank in the j-th channel group, counted from 0. */
  async attributes(j, rank) {
    if (this.parts) {
      const place = this.parts.ofPointPage(rank, this.pointsPerPage);
      const part = await this.part(place.part);
      return inFile(this.parts.records[place.part].name, () => part.attributes(j, place.rank));
    }
    const n = (1 + j) * this.superblock.pointPages + rank;
    return attributeColumns(this.channelsOf(this.schema.groups[j]), this.pointsOf(rank), await this.payload(n));
  }

  /**
   * Loads the node page of a rank.
   * @returns {Promise<import("./payloads.js").Group[]>} the groups by slot
   */
  async nodes(rank) {
    const i = this.parts ? this.parts.ofNodePage(rank) : -1;
    if (i >= 0) return this.nodesOfPart(i, rank);
    const n = this.nodesStart + rank;
    const payload = await this.payload(n);
    const entry = await this.entry(n);
    const limits = { points: this.superblock.points, nodePages: this.nodePages, pointBytes: this.header.pointBytes };
    const groups = readGroups(payload, entry.recordCount, limits, entry.offset, n);
    for (const child of groups.flatMap((group) => group.children)) await this.checkChild(child, entry.offset, n);
    return groups;
  }

  /** Loads a node page of a part; references become those of the scene. */
  async nodesOfPart(i, rank) {
    const { firstNodePage, firstPoint, name } = this.parts.records[i];
    const part = await this.part(i);
    const groups = await inFile(name, () => part.nodes(rank - firstNodePage));
    return groups.map((group) => ({ ...group, children: group.children.map((child) => child.count === undefined
      ? { ...child, page: child.page + firstNodePage } : { ...child, first: child.first + firstPoint }) }));
  }

  /** Checks that a child of a group on this file's page n is there; a partial reader looks at its slot later. */
  async checkChild(child, offset, n) {
    if (child.count !== undefined) {
      const one = !this.parts || this.parts.ofPoint(child.first) === this.parts.ofPoint(child.first + child.count - 1);
      need(one, "parts.md#parts-top", offset, "a leaf has points of two parts", n);
    } else if (this.directory) {
      need(child.slot < (await this.groupsOn(child.page)), this.slotRule(child.page), offset,
        `slot ${child.slot} of node page ${child.page} does not exist`, n);
    }
  }

  /** Returns the number of groups of the node page of a rank. */
  async groupsOn(rank) {
    const i = this.parts ? this.parts.ofNodePage(rank) : -1;
    if (i < 0) return (await this.entry(this.nodesStart + rank)).recordCount;
    return (await this.part(i)).groupsOn(rank - this.parts.records[i].firstNodePage);
  }

  /** Returns the rule that a reference to a slot of a node page keeps. */
  slotRule(rank) {
    return rank < this.superblock.nodePages ? "nodes.md#references" : "parts.md#parts-top";
  }

  /** Loads one group; a partial reader checks its slot here, when it follows the reference. */
  async group(rank, slot) {
    const groups = await this.nodes(rank);
    const own = rank < this.superblock.nodePages;
    need(slot < groups.length, this.slotRule(rank), own ? (await this.entry(this.nodesStart + rank)).offset : 0,
      `slot ${slot} of node page ${rank} does not exist`, own ? this.nodesStart + rank : undefined);
    return groups[slot];
  }
}
