/**
 * A verifier of the PTCX container, levels 0 to 3 of spec/container.md#verify. It stops at the first
 * broken rule.
 */

import { PART } from "./parts.js";
import { need, Refused } from "./rules.js";
import { ATTRIBUTE, BLOCK, Container, ENTRY, inFile, isVoid, NODE, PAGE_HEADER, PARTS, POINT,
  readExactly } from "./reader.js";
import { checkEmission, checkNode, leafSummary, sumOf } from "./summary.js";
import { allZero, compareKeys, halfValue, KEY_LIMIT, keyHigh, octahedral, pointOfKey } from "./values.js";

/** Bytes of padding that are read at once, and node pages that are kept. */
const CHUNK = 1 << 20, KEPT_PAGES = 64;

/**
 * Verifies a file; an error of class Refused says which rule it breaks. From level 1 on, parts of a scene are verified
 * to the same level, one by one.
 * @param {{length: number, read: Function, sibling: Function}} source
 * @param {number} [level] 0 to 3
 * @param {boolean} [asPart] whether the file is a part of a scene
 * @returns {Promise<Container>} the open container
 */
export async function verify(source, level = 3, asPart = false) {
  const container = await Container.openSuperblock(source, asPart);
  for (const copy of container.damaged) {
    const rule = copy.magic ? "superblock-checksum" : "superblock-magic";
    throw new Refused(`container.md#${rule}`, copy.offset, "one of the two superblocks is not whole");
  }
  if (level >= 1) {
    await container.readDirectory();
    await eachPage(container, (n, entry) => container.pageHeader(entry.offset, container.placeOf(n, entry), n, entry));
  }
  if (level >= 2) {
    await eachPage(container, async (n, entry) => {
      const head = await container.pageHeader(entry.offset, container.placeOf(n, entry), n, entry);
      await container.storedPayload(n, entry, head);
    });
    await checkPadding(container);
  }
  if (level >= 3 || (level >= 1 && container.header.hasParts)) {
    await container.readMeta();
    await container.readParts();
    await verifyParts(container, level);
  }
  if (level >= 3) {
    await checkPages(container);
    await new TreeWalk(container).run();
  }
  return container;
}

/** Verifies the parts of a scene, each as a file of its own, and then as parts of this scene. */
async function verifyParts(container, level) {
  for (const [i, record] of (container.parts?.records ?? []).entries()) {
    await inFile(record.name, async () => {
      const source = await container.source.sibling(record.name);
      need(source !== undefined, "parts.md#parts-file", 0, "there is no such part");
      const part = await verify(source, level, true);
      if (level < 3) return;
      const keys = [(await part.points(0)).position, (await part.points(part.pointPages - 1)).position];
      const [first, last] = keys.map((axes, k) => axes.map((axis) => axis.at(-k)));
      need(sameKey(first, record.firstKey) && sameKey(last, record.lastKey), "parts.md#parts-file", 0,
        "the first or the last point has another key");
    });
    await container.part(i);
  }
  await container.openParts();
}

/** Says whether a lattice point has a key. */
function sameKey(point, key) {
  return compareKeys(...point, ...pointOfKey(key >> 63n, key % KEY_LIMIT)) === 0;
}

/** Calls a function with number and entry of every page that the file holds. */
async function eachPage(container, visit) {
  for (let n = 0; n < container.superblock.pageCount; n++) {
    const entry = await container.entry(n);
    if (!isVoid(entry)) await visit(n, entry);
  }
}

/** Checks that every byte outside of headers, payloads, directory and superblocks is zero. */
async function checkPadding(container) {
  const s = container.superblock;
  const taken = [];
  await eachPage(container, (n, entry) => {
    taken.push({ from: entry.offset, to: entry.offset + PAGE_HEADER + entry.storedBytes });
  });
  for (let rank = 0; rank < s.directoryPages; rank++) {
    const from = s.directoryOffset + rank * container.header.pageSize;
    const entries = Math.min(container.entriesPerPage, s.pageCount - rank * container.entriesPerPage);
    taken.push({ from, to: from + PAGE_HEADER + ENTRY * entries });
  }
  taken.push({ from: s.fileBytes - 2 * BLOCK, to: s.fileBytes });
  taken.sort((a, b) => a.from - b.from);
  let at = BLOCK;
  for (const { from, to } of taken) {
    for (; at < from; at += Math.min(CHUNK, from - at)) {
      const gap = await readExactly(container.source, at, Math.min(CHUNK, from - at));
      need(allZero(gap), "container.md#padding", at, "a byte of padding is set");
    }
    at = to;
  }
}

/** Decodes every page; compares keys, levels, order of points, bounds and totals with the records. */
async function checkPages(container) {
  const s = container.superblock;
  const { origin, unit } = container.header;
  const totals = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity], area: 0,
    flux: [0, 0, 0] };
  let before;
  await eachPage(container, async (n, entry) => {
    const check = (good, rule, text) => need(good, rule, entry.offset, text, n);
    const head = await container.pageHeader(entry.offset, container.placeOf(n, entry), n, entry);
    const keysAre = (first, last) => check(head.firstKey === first && head.lastKey === last,
      "container.md#page-keys", "the keys of the page are not those of its records");
    if (entry.type === POINT) {
      const points = await container.points(n);
      const at = (i) => points.position.map((axis) => axis[i]);
      keysAre(keyHigh(...at(0)), keyHigh(...at(points.count - 1)));
      check(!before || compareKeys(...before, ...at(0)) <= 0, "points.md#point-order",
        "the page's first point lies before the last one of the page ahead of it");
      before = at(points.count - 1);
      addTotals(totals, points, origin, unit);
    } else if (entry.type === ATTRIBUTE) {
      await container.payload(n);
    } else if (entry.type === NODE) {
      const groups = await container.nodes(n - container.nodesStart);
      const cells = groups.map((group) => group.cellHigh).sort((a, b) => (a < b ? -1 : a > b ? 1 : 0));
      keysAre(cells[0], cells.at(-1));
      check(entry.level === Math.min(...groups.map((group) => group.level)), "container.md#page-level",
        "the level of the page is not the least of its groups");
    } else if (entry.type === PARTS) {
      const start = (n - container.nodesEnd) * Math.floor((container.header.pageSize - PAGE_HEADER) / PART);
      const records = container.parts.records.slice(start, start + entry.recordCount);
      keysAre(records[0].firstKey >> 63n, records.at(-1).lastKey >> 63n);
    }
  });
  if (container.parts) {
    for (let rank = 0; rank < container.pointPages; rank++) {
      addTotals(totals, await container.points(rank), origin, unit);
    }
  }
  if (s.points === 0) totals.low = totals.high = [0, 0, 0];
  checkTotals(s, totals);
}

/** Adds the points of a page to bounds, area and flux. */
function addTotals(totals, points, origin, unit) {
  points.position.forEach((axis, k) => {
    for (const q of axis) {
      const place = origin[k] + q * unit;
      totals.low[k] = Math.min(totals.low[k], place);
      totals.high[k] = Math.max(totals.high[k], place);
    }
  });
  for (let i = 0; i < points.count; i++) {
    const area = 2 * points.radius[i] ** 2;
    totals.area += area;
    for (let c = 0; c < 3; c++) {
      const emission = points.emission.length ? halfValue(points.emission[c][i]) : 0;
      totals.flux[c] += area * (halfValue(points.radiance[c][i]) + emission);
    }
  }
}

/** Compares bounds, area and flux of the superblock with those of the points. */
function checkTotals(s, totals) {
  const check = (good, at, text) => need(good, "container.md#superblock-totals", s.offset + at, text);
  const near = (stored, sum) => Math.abs(stored - sum) <= 1e-6 * sum;
  for (let k = 0; k < 3; k++) {
    check(s.boundsLow[k] === totals.low[k], 232 + 8 * k, "the lower bounds are not those of the points");
    check(s.boundsHigh[k] === totals.high[k], 256 + 8 * k, "the upper bounds are not those of the points");
    check(near(s.flux[k], totals.flux[k]), 288 + 8 * k, "the flux is not that of the points");
  }
  check(near(s.area, totals.area), 280, "the area is not that of the points");
}

/** Gives the points of a file or a scene one after another, with the rank of each among those of equal keys. */
class PointCursor {
  constructor(container) {
    this.container = container;
    this.next = 0;
    this.page = undefined;
    this.pageRank = -1;
    this.first = 0;
    this.last = undefined;
  }

  /** Returns the next point without passing over it: its position and its rank. */
  async peek() {
    if (!this.page || this.next >= this.first + this.page.count) {
      this.pageRank++;
      this.page = await this.container.points(this.pageRank);
      this.first = this.next;
    }
    const position = this.page.position.map((axis) => axis[this.next - this.first]);
    const same = this.last && this.last.position.every((value, k) => value === position[k]);
    return { position, rank: same ? this.last.rank + 1 : 0 };
  }

  /**
   * Returns the next points, and passes over them.
   * @returns {Promise<import("./summary.js").Run & {from: object, to: object}>} `from` and `to` are position
   *   and rank of the first and the last point
   */
  async take(count) {
    const run = { count, position: [], radius: [], normal: [], radiance: [], emission: [] };
    for (let i = 0; i < count; i++) {
      const point = await this.peek();
      const { radius, normal, radiance, emission } = this.page;
      const at = this.next - this.first;
      run.position.push(point.position);
      run.radius.push(radius[at]);
      run.normal.push(octahedral(normal[0][at], normal[1][at], 32767));
      run.radiance.push(radiance.map((column) => halfValue(column[at])));
      run.emission.push(emission.length ? emission.map((column) => halfValue(column[at])) : [0, 0, 0]);
      run.from ??= point;
      run.to = point;
      this.last = point;
      this.next++;
    }
    return run;
  }
}

/** Returns the coordinates of a cell of a level, in units of its edge. */
function cellOf(position, level) {
  return position.map((value) => Math.floor(value / 2 ** Math.max(0, 42 - level)));
}

/** Returns the digits of a rank down to a level below 42, as a number. */
function rankPrefix(rank, level) {
  return level <= 42 ? 0 : Math.floor(rank / 8 ** (62 - level));
}

/** Returns the digit of a point at a level: of its key, or of its rank below level 42. */
function digitOf({ position, rank }, level) {
  if (level > 42) return rankPrefix(rank, level) % 8;
  const bit = position.map((value) => Math.floor(value / 2 ** (42 - level)) % 2);
  return bit[0] + 2 * bit[1] + 4 * bit[2];
}

/** Says whether two points lie in one cell of a level. */
function shareCell(a, b, level) {
  const other = cellOf(b.position, level);
  return cellOf(a.position, level).every((value, k) => value === other[k]) &&
    rankPrefix(a.rank, level) === rankPrefix(b.rank, level);
}

/** Walks the tree from the root, depth first, and compares every node with its points. */
class TreeWalk {
  constructor(container) {
    this.container = container;
    this.cursor = new PointCursor(container);
    this.reached = new Map();
    this.pages = new Map();
    this.groups = 0;
    this.nodes = 0;
    this.levels = 0;
  }

  /** Walks the whole tree. */
  async run() {
    const s = this.container.superblock;
    const stack = s.points > 0 ? [await this.open(s.rootPage, s.rootSlot, undefined)] : [];
    while (stack.length > 0) {
      const frame = stack.at(-1);
      const i = frame.summaries.length;
      if (i < frame.group.children.length) {
        const child = frame.group.children[i];
        if (child.count === undefined) stack.push(await this.open(child.page, child.slot, frame));
        else await this.closeLeaf(frame, i, child);
      } else {
        stack.pop();
        this.closeGroup(frame, stack.at(-1));
      }
    }
    this.checkCounts(s);
  }

  /** Returns the groups of a node page; the latest pages are kept. */
  async page(rank) {
    const groups = this.pages.get(rank) ?? (await this.container.nodes(rank));
    this.pages.delete(rank);
    this.pages.set(rank, groups);
    if (this.pages.size > KEPT_PAGES) this.pages.delete(this.pages.keys().next().value);
    return groups;
  }

  /**
   * Reaches a group, and checks it against the group of its parent node. What is wrong between a group of a scene and
   * one of a part breaks parts-top (spec/parts.md#verifying).
   */
  async open(rank, slot, parent) {
    const own = rank < this.container.superblock.nodePages;
    const number = own ? this.container.nodesStart + rank : undefined;
    const offset = own ? (await this.container.entry(number)).offset : parent.offset;
    const leadsToPart = !own && parent.own;
    const check = (good, rule, text) => need(good, leadsToPart ? "parts.md#parts-top" : `nodes.md#${rule}`, offset,
      `slot ${slot}: ${text}`, number);

    // Refuse a group that was reached before.
    const slots = this.reached.get(rank) ?? new Uint8Array(await this.container.groupsOn(rank));
    this.reached.set(rank, slots);
    check(slots[slot] === 0, "references", "the group is reached twice");
    slots[slot] = 1;

    // Check level, cell and octant.
    const group = (await this.page(rank))[slot];
    const low = pointOfKey(group.cellHigh, group.cellLow);
    if (own) {
      this.groups++;
      this.nodes += group.children.length;
      this.levels = Math.max(this.levels, group.level + 1);
    }
    if (leadsToPart) {
      check((await this.firstPoint(group)) === this.cursor.next, "node-leaf", "its points do not follow those before");
    }
    check(this.cursor.next < this.container.superblock.points, "node-leaf", "no points are left for the group");
    const point = await this.cursor.peek();
    if (parent) {
      const { level } = parent.group;
      check(group.level > level, "node-level", `level ${group.level} is not above its parent's, ${level}`);
      const corner = { position: low, rank: point.rank };
      check(shareCell(corner, parent.first, level), "node-cell", "the cell is not in that of the parent");
      this.enterOctant(parent, digitOf(corner, level + 1), check);
    }
    const first = { position: low, rank: point.rank };
    const leafRoot = !parent && group.children.length === 1 && group.children[0].count !== undefined;
    check(leafRoot || group.children.length >= 2, "node-children", "the group has one child");
    check(!leafRoot || group.level === 0, "node-level", "the level of a root that is a leaf is not 0");
    return { group, first, leafRoot, offset, number, own, check, octant: -1, summaries: [] };
  }

  /** Returns the number of the first point below a group of a part, which was verified before. */
  async firstPoint(group) {
    let child = group.children[0];
    while (child.count === undefined) child = (await this.page(child.page))[child.slot].children[0];
    return child.first;
  }

  /** Checks that the next child of a group lies in an octant behind those of the children before it. */
  enterOctant(frame, octant, check) {
    check(octant > frame.octant, "node-children", "children share an octant or are out of order");
    frame.octant = octant;
  }

  /** Checks child i of a group, a leaf. */
  async closeLeaf(frame, i, { first, count }) {
    const { group } = frame;
    const leadsToPart = this.container.parts && frame.own;
    const check = leadsToPart
      ? (good, rule, text) => need(good, "parts.md#parts-top", frame.offset, text, frame.number) : frame.check;
    check(first === this.cursor.next, "node-leaf", `a leaf starts at point ${first} and not at ${this.cursor.next}`);
    check(count <= this.container.superblock.leafPoints, "node-leaf", `a leaf has ${count} points`);
    const run = await this.cursor.take(count);
    check(shareCell(run.from, frame.first, group.level) && shareCell(run.to, frame.first, group.level),
      "node-cell", "points lie outside the cell of their group");
    if (!frame.leafRoot) {
      check(shareCell(run.from, run.to, group.level + 1), "node-children", "points of a leaf lie in several octants");
      this.enterOctant(frame, digitOf(run.from, group.level + 1), check);
    }
    const summary = leafSummary(run, this.container.header.unit);
    checkNode(group, i, summary, run, this.container.header.unit, frame.offset, frame.number);
    frame.summaries.push(summary);
  }

  /** Checks a group whose children are done, and then the node that it belongs to. */
  closeGroup({ group, summaries, check, leafRoot }, parent) {
    const summary = sumOf(summaries);
    check(leafRoot || summary.points > this.container.superblock.leafPoints, "node-leaf",
      `a group has only ${summary.points} points`);
    checkEmission(group, summaries, check);
    if (!parent) return;
    const i = parent.summaries.length;
    checkNode(parent.group, i, summary, undefined, this.container.header.unit, parent.offset, parent.number);
    parent.summaries.push(summary);
  }

  /** Compares what the walk met with what the superblock counts. */
  checkCounts(s) {
    const check = (good, rule, at, text) => need(good, rule, s.offset + at, text);
    for (const part of this.container.opened) {
      this.groups += part.superblock.nodeGroups;
      this.nodes += part.superblock.nodes;
      this.levels = Math.max(this.levels, part.superblock.levels);
    }
    check(this.groups === s.nodeGroups, "nodes.md#references", 192,
      `${this.groups} of ${s.nodeGroups} groups are reached`);
    check(this.cursor.next === s.points, "nodes.md#node-leaf", 176,
      `leaves hold ${this.cursor.next} of ${s.points} points`);
    check(this.nodes === s.nodes, "container.md#superblock-counts", 184,
      `the groups have ${this.nodes} children, and the superblock says ${s.nodes}`);
    check(this.levels === s.levels, "container.md#superblock-root", 166,
      `the groups have ${this.levels} levels, and the superblock says ${s.levels}`);
  }
}
