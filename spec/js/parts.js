/**
 * The records of a scene of parts (spec/parts.md), and which part has a point or a page of the scene.
 *
 *     ranks of node pages   | the scene's own: 0 1 | part 0: 2 3 4 | part 1: 5 6 | ...
 *     numbers of points                            | part 0: 0 ... | part 1: ... | ...
 */

import { need } from "./rules.js";
import { allZero, big, KEY_LIMIT, textOf, u64, viewOf } from "./values.js";

/** Bytes of a record. */
export const PART = 384;

/** Most points of a scene, and most node pages. */
const POINT_LIMIT = 2 ** 48, NODE_PAGE_LIMIT = 2 ** 32 - 2;

/**
 * A record of a parts page.
 * @typedef {object} PartRecord
 * @property {Uint8Array} uuid
 * @property {bigint} superblockHash
 * @property {number} fileBytes
 * @property {number} firstPoint
 * @property {number} points
 * @property {number} firstNodePage
 * @property {number} nodePages
 * @property {bigint} firstKey high half 2^63 + low half
 * @property {bigint} lastKey
 * @property {string} name path from the folder of the scene
 */

/** Reads the name at the end of a record; undefined when it is no path below the scene's folder. */
function readName(bytes) {
  const end = bytes.indexOf(0);
  if (end < 1 || !allZero(bytes, end)) return undefined;
  const name = textOf(bytes.subarray(0, end));
  return name?.split("/").some((step) => ["", ".", ".."].includes(step)) ? undefined : name;
}

/** The parts of a scene in the order of the curve, collected page by page. */
export class PartList {
  /** @param {number} ownNodePages node pages of the scene's own file */
  constructor(ownNodePages) {
    this.ownNodePages = ownNodePages;
    /** Node pages of the scene and of the parts so far. */
    this.nodePages = ownNodePages;
    /** Points of the parts so far. */
    this.points = 0;
    /** @type {PartRecord[]} */
    this.records = [];
  }

  /**
   * Reads and checks the records of the next parts page.
   * @param {Uint8Array} payload
   * @param {number} place offset of the payload in the file
   * @param {number} page number of the page
   */
  add(payload, place, page) {
    for (let at = 0; at < payload.length; at += PART) {
      this.addRecord(payload.subarray(at, at + PART), (good, rule, field, text) =>
        need(good, `parts.md#parts-${rule}`, place + at + field, text, page));
    }
  }

  /** Reads and checks one record. */
  addRecord(bytes, check) {
    const view = viewOf(bytes);
    const halves = [56, 64, 72, 80].map((at) => big(view, at));
    const name = readName(bytes.subarray(128));
    const record = { uuid: bytes.slice(0, 16), superblockHash: big(view, 16), fileBytes: u64(view, 24),
      firstPoint: u64(view, 32), points: u64(view, 40), firstNodePage: view.getUint32(48, true),
      nodePages: view.getUint32(52, true), firstKey: (halves[0] << 63n) | halves[1],
      lastKey: (halves[2] << 63n) | halves[3], name };
    check(allZero(bytes, 88, 128), "zero", 88, "a reserved byte is set");
    check(name !== undefined, "name", 128, "the name is no path below the scene's folder, followed by zeros");
    check(this.records.every((other) => other.name !== name), "name", 128, "two parts have one name");
    check(record.firstPoint === this.points, "count", 32, `first_point is not ${this.points}`);
    check(record.points >= 1 && record.points <= POINT_LIMIT - this.points, "count", 40,
      `the part has ${record.points} points`);
    check(record.firstNodePage === this.nodePages, "count", 48, `first_node_page is not ${this.nodePages}`);
    check(record.nodePages <= NODE_PAGE_LIMIT - this.nodePages, "count", 52, "there are too many node pages");
    check(halves.every((half) => half < KEY_LIMIT), "order", 56, "bit 63 of a key is set");
    check(record.firstKey <= record.lastKey, "order", 56, "the keys descend");
    check(this.records.length === 0 || this.records.at(-1).lastKey < record.firstKey, "order", 56,
      "the part does not lie behind the one before it");
    this.records.push(record);
    this.points += record.points;
    this.nodePages += record.nodePages;
  }

  /** Returns the number of the part that has a point, or the last part. */
  ofPoint(point) {
    return this.records.findLastIndex((record) => record.firstPoint <= point);
  }

  /** Returns the number of the part that has the node page of a rank; -1 when it is the scene's own. */
  ofNodePage(rank) {
    return this.records.findLastIndex((record) => record.firstNodePage <= rank);
  }

  /** Returns how many point pages the parts have. */
  pointPages(pointsPerPage) {
    return this.records.reduce((sum, record) => sum + Math.ceil(record.points / pointsPerPage), 0);
  }

  /** Returns the number of the part that has the point page of a rank, and the rank in that part. */
  ofPointPage(rank, pointsPerPage) {
    let local = rank;
    let part = 0;
    for (; local >= Math.ceil(this.records[part].points / pointsPerPage); part++) {
      local -= Math.ceil(this.records[part].points / pointsPerPage);
    }
    return { part, rank: local };
  }
}

/** Returns a text of the file with its control characters escaped. */
export function shown(text) {
  return text.replace(/\p{C}/gu, (c) => `\\u{${c.codePointAt(0).toString(16)}}`);
}
