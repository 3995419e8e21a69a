/**
 * The summary of a node's surfels (spec/nodes.md#summary) in float64, and the comparison of what is
 * stored with it, within the tolerances of spec/nodes.md#tolerances.
 */

import { need } from "./rules.js";
import { octahedral, pointOfKey, rgbeValue, UFLOAT_MAX, ufloatNearest, ufloatValue } from "./values.js";

/** Tolerance of positions and lengths, lattice units, and the share by which rounding up exceeds. */
const LENGTH_SLACK = 2 ** -8, ROUND_UP = 1 + 2 ** -8;

/** Tolerance of sums, as a share of the area. */
const SUM_SLACK = 1e-6;

/** Greatest length, so that products with sines and cosines of 0 stay numbers. */
const LENGTH_MAX = 1e300;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const cross = (a, b) =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const angle = (a, b) => Math.atan2(norm(cross(a, b)), dot(a, b));

/**
 * The points of a leaf, a value for each point.
 * @typedef {object} Run
 * @property {number} count
 * @property {number[][]} position lattice coordinates
 * @property {number[]} radius scene units
 * @property {number[][]} normal unit vectors
 * @property {number[][]} radiance r, g, b
 * @property {number[][]} emission r, g, b
 */

/**
 * What a summary holds before it is rounded. A bound with `low` and `high` has two values where the
 * direction of V is doubtful, in this node or below it, because both are accepted there.
 * @typedef {object} Summary
 * @property {number} points
 * @property {number} area
 * @property {number[]} mean lattice coordinates
 * @property {number} radius of the sphere, lattice units
 * @property {number} greatest lattice units
 * @property {number[]} facing for each of the six axes
 * @property {number[][]} flux r, g, b for each of the six axes
 * @property {number[][]} power r, g, b for each of the six axes
 * @property {number} brightest greatest radiance below
 * @property {number} brightestEmission greatest emission below
 * @property {number[]} axis V / |V|
 * @property {boolean} flat whether |V| <= 10^-6 of the area, so that the cone is all directions
 * @property {boolean} doubtful whether |V| is 10^-7 to 10^-5 of the area
 * @property {{low: number, high: number}} half half angle of the cone about `axis`
 * @property {{low: number, high: number}} slab thickness of the slab
 */

/** Returns axis, flat and doubtful as the six facings give them. */
function directionOf(facing, area) {
  const v = [facing[0] - facing[1], facing[2] - facing[3], facing[4] - facing[5]];
  const length = norm(v);
  const axis = length > 0 ? v.map((value) => value / length) : [0, 0, 1];
  return { axis, flat: length <= 1e-6 * area, doubtful: length > 0 && length >= 1e-7 * area && length <= 1e-5 * area };
}

/** Returns a bound that is open where V is flat or doubtful, up to the value that it then has. */
function boundOf({ flat, doubtful }, low, high, otherwise) {
  const limit = (value) => Math.min(value, otherwise);
  if (doubtful) return { low: limit(low), high: otherwise };
  return flat ? { low: otherwise, high: otherwise } : { low: limit(low), high: limit(high) };
}

const emptySums = () => Array.from({ length: 6 }, () => [0, 0, 0]);

/**
 * Returns the summary of a leaf's points.
 * @param {Run} run
 * @param {number} unit scene units of a lattice unit
 * @returns {Summary}
 */
export function leafSummary(run, unit) {
  // Add up areas, positions and light.
  const facing = new Array(6).fill(0);
  const flux = emptySums();
  const power = emptySums();
  const origin = run.position[0];
  const offset = [0, 0, 0];
  const middle = [0, 0, 0];
  let area = 0;
  let greatest = 0;
  let brightest = 0;
  let brightestEmission = 0;
  for (let i = 0; i < run.count; i++) {
    const a = 2 * run.radius[i] ** 2;
    const from = minus(run.position[i], origin);
    area += a;
    greatest = Math.max(greatest, Math.min(run.radius[i] / unit, LENGTH_MAX));
    brightest = Math.max(brightest, ...run.radiance[i]);
    brightestEmission = Math.max(brightestEmission, ...run.emission[i]);
    for (let c = 0; c < 3; c++) {
      offset[c] += a * from[c];
      middle[c] += from[c];
    }
    for (let k = 0; k < 6; k++) {
      const share = a * Math.max(0, run.normal[i][k >> 1] * (k % 2 ? -1 : 1));
      facing[k] += share;
      for (let c = 0; c < 3; c++) {
        flux[k][c] += share * run.radiance[i][c];
        power[k][c] += share * run.emission[i][c];
      }
    }
  }
  const mean = origin.map((value, c) => value + (area > 0 ? offset[c] / area : middle[c] / run.count));

  // Bound discs by sphere, slab and cone.
  const direction = directionOf(facing, area);
  let radius = 0;
  let slab = 0;
  let half = 0;
  for (let i = 0; i < run.count; i++) {
    const r = Math.min(run.radius[i] / unit, LENGTH_MAX);
    const from = minus(run.position[i], mean);
    radius = Math.max(radius, norm(from) + r);
    slab = Math.max(slab, Math.abs(dot(from, direction.axis)) + norm(cross(run.normal[i], direction.axis)) * r);
    half = Math.max(half, angle(run.normal[i], direction.axis));
  }
  return { points: run.count, area, mean, radius, greatest, facing, flux, power, brightest, brightestEmission,
    ...direction, half: boundOf(direction, half, half, Math.PI), slab: boundOf(direction, slab, slab, radius) };
}

/**
 * Returns the summary of an interior node, or of the whole file, from those of its children.
 * @param {Summary[]} children
 * @returns {Summary}
 */
export function sumOf(children) {
  const add = (value) => children.reduce((sum, child) => sum + value(child), 0);
  const most = (value) => children.reduce((sum, child) => Math.max(sum, value(child)), 0);
  const sums = (name) => emptySums().map((axis, k) => axis.map((_, c) => add((child) => child[name][k][c])));
  const area = add((child) => child.area);
  const origin = children[0].mean;
  const mean = origin.map((value, c) => value + (area > 0
    ? add((child) => child.area * (child.mean[c] - value)) / area
    : add((child) => child.mean[c] - value) / children.length));
  const facing = [0, 1, 2, 3, 4, 5].map((k) => add((child) => child.facing[k]));
  const direction = directionOf(facing, area);
  const radius = most((child) => norm(minus(child.mean, mean)) + child.radius);
  const half = (end) => most((child) => child.half[end] + angle(child.axis, direction.axis));
  const height = (end) => most((child) => {
    const open = end === "low" ? child.flat && !child.doubtful : child.flat || child.doubtful;
    const cosine = Math.abs(dot(child.axis, direction.axis));
    const sine = norm(cross(child.axis, direction.axis));
    const own = open ? child.radius : child.slab[end] * cosine + child.radius * sine;
    return Math.abs(dot(minus(child.mean, mean), direction.axis)) + Math.min(child.radius, own);
  });
  return { points: add((child) => child.points), area, mean, radius, greatest: most((child) => child.greatest),
    facing, flux: sums("flux"), power: sums("power"), brightest: most((child) => child.brightest),
    brightestEmission: most((child) => child.brightestEmission), ...direction,
    half: boundOf(direction, half("low"), half("high"), Math.PI),
    slab: boundOf(direction, height("low"), height("high"), radius) };
}

/** Says whether a stored bound is at least the greatest finite number or what is needed, and not much more. */
function boundHolds(stored, low, high = low) {
  const slack = LENGTH_SLACK + 1e-12 * high;
  return (stored >= low - slack || stored === UFLOAT_MAX) && stored <= (high + slack) * ROUND_UP;
}

/** Returns the exponent E of rgbe: the integer with 2^(E-1) <= m < 2^E, clamped to -128..127. */
function rgbeExponent(m) {
  if (m <= 0) return -128;
  const exponent = Math.floor(Math.log2(m)) + 1;
  const exact = m >= 2 ** exponent ? exponent + 1 : m < 2 ** (exponent - 1) ? exponent - 1 : exponent;
  return Math.min(127, Math.max(-128, exact));
}

/** Says whether an rgbe is that of sums divided by a facing, both within their tolerances. */
function rgbeHolds(bits, sums, facing, area, brightest) {
  const slack = SUM_SLACK * area;
  const low = sums.map((sum) => Math.max(0, sum - slack * brightest) / (facing + slack));
  const high = sums.map((sum) => (facing > slack ? (sum + slack * brightest) / (facing - slack) : Infinity));
  const exponent = (bits >>> 24) - 128;
  if (exponent < rgbeExponent(Math.max(...low)) || exponent > rgbeExponent(Math.max(...high))) return false;
  const step = 2 ** (exponent - 8);
  const half = (step / 2) * (1 + 1e-9);
  return rgbeValue(bits).every((value, c) => {
    const cut = value === 255 * step ? step : half;
    return value >= low[c] - cut && value <= high[c] + half;
  });
}

/** Says whether a stored cone is that about an axis, its half angle between two. */
function coneHolds(axis, cosine, wanted, half) {
  const apart = angle(axis, wanted);
  if (apart > 0.018) return false;
  const widest = Math.min(Math.PI, half.high + apart + 1e-3);
  const narrowest = Math.min(Math.PI, Math.max(0, half.low + apart - 1e-3));
  return cosine <= Math.cos(narrowest) + 1e-5 && cosine >= Math.cos(widest) - 1e-6 - 1 / 32767;
}

/**
 * Refuses a file unless what is stored of a node, but for its emission, is the summary of its points.
 * @param {import("./payloads.js").Group} group
 * @param {number} i the node's place in its group
 * @param {Summary} summary of the points below the node
 * @param {Run|undefined} run the points of a leaf
 * @param {number} unit scene units of a lattice unit
 * @param {number} offset of the group's page in the file
 * @param {number} page its number
 */
export function checkNode(group, i, summary, run, unit, offset, page) {
  const check = (good, rule, text) => need(good, `nodes.md#${rule}`, offset, `child ${i} of a group: ${text}`, page);
  const edge = 2 ** Math.max(0, 42 - group.level);
  const corner = pointOfKey(group.cellHigh, group.cellLow);

  // Compare the mean, then the bounds about the stored mean.
  const mean = corner.map((low, c) => low + (group.mean[c][i] * edge) / 65536);
  mean.forEach((value, c) => {
    const steps = group.mean[c][i] === 65535 ? 1 : 0.5;
    const apart = Math.abs(value - summary.mean[c]);
    check(apart <= (steps * edge) / 65536 + LENGTH_SLACK, "node-mean", `the mean is off by ${apart}`);
  });
  const moved = norm(minus(mean, summary.mean));
  const sphere = summary.radius + moved;
  const radius = ufloatValue(group.radius[i]);
  check(boundHolds(radius, sphere), "node-sphere", `the radius is ${radius} and not ${sphere}`);
  const greatest = ufloatValue(group.greatest[i]);
  check(boundHolds(greatest, summary.greatest), "node-greatest",
    `the greatest radius is ${greatest} and not ${summary.greatest}`);

  // Compare the sums.
  const codes = [1 - SUM_SLACK, 1 + SUM_SLACK].map((factor) => ufloatNearest(summary.area * factor));
  check(group.area[i] >= codes[0] && group.area[i] <= codes[1], "node-sums",
    `the area is ${ufloatValue(group.area[i])} and not ${summary.area}`);
  for (let k = 0; k < 6; k++) {
    const stored = group.facing[k][i];
    const share = group.area[i] === 0 ? 0 : summary.facing[k] / summary.area;
    const slack = group.area[i] === 0 ? 0 : SUM_SLACK;
    const code = (value) => Math.min(65535, Math.max(0, Math.floor(65535 * value + 0.5)));
    check(stored >= code(share - slack) && stored <= code(share + slack), "node-sums",
      `facing ${k} is ${stored / 65535} and not ${share}`);
    check(stored === 0 || rgbeHolds(group.radiance[k][i], summary.flux[k], summary.facing[k], summary.area,
      summary.brightest), "node-sums", `radiance ${k} is not that of the points`);
  }

  // Compare the slab, which the stored facing tilts.
  const normal = checkSlab(group, i, summary, moved, sphere, check);

  // Compare the cone: that of V, or all directions about +z, or either of them.
  const axis = octahedral(group.coneAxis[0][i], group.coneAxis[1][i], 127);
  const cosine = Math.max(group.coneCos[i], -32767) / 32767;
  const ofV = (!summary.flat || summary.doubtful) && coneHolds(axis, cosine, summary.axis, summary.half);
  const all = (summary.flat || summary.doubtful) &&
    coneHolds(axis, cosine, [0, 0, 1], { low: Math.PI, high: Math.PI });
  check(ofV || all, "node-cone", "the cone is not that of the normals");
  if (!run) return;
  const stored = { mean, radius, normal, thickness: ufloatValue(group.thickness[i]), axis, cosine };
  checkDiscs(run, stored, unit, check);
}

/**
 * Refuses a file unless a group's flag of emission and the columns of emission are those of its points.
 * @param {import("./payloads.js").Group} group
 * @param {Summary[]} summaries of the group's children
 * @param {(good: boolean, rule: string, text: string) => void} check
 */
export function checkEmission(group, summaries, check) {
  const emits = summaries.some((summary) => summary.brightestEmission > 0);
  check(group.emits === emits, "node-emission", "the flag of emission is not what the points say");
  group.emission.forEach((column, k) => summaries.forEach((summary, i) => {
    const good = group.facing[k][i] === 0 || rgbeHolds(column[i], summary.power[k], summary.facing[k], summary.area,
      summary.brightestEmission);
    check(good, "node-sums", `emission ${k} of child ${i} is not that of the points`);
  }));
}

/** Compares the slab, and returns the direction of the stored V, or undefined when it is 0. */
function checkSlab(group, i, summary, moved, sphere, check) {
  const facing = group.facing.map((column) => column[i]);
  const v = [facing[0] - facing[1], facing[2] - facing[3], facing[4] - facing[5]];
  const length = norm(v);
  const normal = length > 0 ? v.map((value) => value / length) : undefined;
  const tilt = normal ? summary.radius * norm(minus(normal, summary.axis)) : Infinity;
  const limits = [summary.slab.low, summary.slab.high].map((slab) => Math.min(sphere, slab + tilt + moved));
  const high = summary.flat || summary.doubtful ? sphere : limits[1];
  const low = summary.flat && !summary.doubtful ? sphere : limits[0];
  const thickness = ufloatValue(group.thickness[i]);
  check(boundHolds(thickness, low, high), "node-slab", `the thickness is ${thickness}, and ${low} to ${high} is right`);
  return normal;
}

/** Checks that sphere, slab and cone of a leaf hold every disc. */
function checkDiscs(run, stored, unit, check) {
  for (let n = 0; n < run.count; n++) {
    const r = Math.min(run.radius[n] / unit, LENGTH_MAX);
    const from = minus(run.position[n], stored.mean);
    const holds = (bound, reach) => bound === UFLOAT_MAX || reach <= bound + LENGTH_SLACK + 1e-12 * reach;
    check(holds(stored.radius, norm(from) + r), "node-sphere", `the sphere does not hold disc ${n}`);
    const reach = stored.normal
      ? Math.abs(dot(from, stored.normal)) + norm(cross(run.normal[n], stored.normal)) * r : 0;
    check(holds(stored.thickness, reach), "node-slab", `the slab does not hold disc ${n}`);
    check(dot(run.normal[n], stored.axis) >= stored.cosine - 1e-5, "node-cone", `the cone does not hold normal ${n}`);
  }
}
