/**
 * Writes to standard output what packages of npm read of a file of points, for npm_peer.py.
 *
 * node npm_peer.mjs FOLDER check            nothing; fails where a package is missing below FOLDER
 * node npm_peer.mjs FOLDER laz FILE EVERY   by laz-perf: a line of JSON, then the first of every EVERY records
 * node npm_peer.mjs FOLDER copc FILE        by copc: a line of JSON, then for each point a double for each dimension
 * node npm_peer.mjs FOLDER e57 FILE         by web-e57: a line of text for each point, its place and its colour
 */

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, work, file, every] = process.argv.slice(2);
const require = createRequire(pathToFileURL(join(folder, "npm_peer.mjs")));

function write(facts, bytes) {
  process.stdout.write(JSON.stringify(facts) + "\n");
  process.stdout.write(bytes);
}

/** Returns web-e57's function. Its module is loaded by hand, since not every release of Node imports WebAssembly. */
async function loadE57() {
  const path = require.resolve("web-e57").replace(/\.js$/, "_bg");
  const functions = await import(pathToFileURL(path + ".js"));
  const code = await WebAssembly.compile(readFileSync(path + ".wasm"));
  const { exports } = await WebAssembly.instantiate(code, { "./e57_bg.js": functions });
  functions.__wbg_set_wasm(exports);
  return functions.convertE57;
}

async function readLaz() {
  const perf = await require("laz-perf").createLazPerf();
  const bytes = readFileSync(file);
  const data = perf._malloc(bytes.length);
  perf.HEAPU8.set(bytes, data);
  const reader = new perf.LASZip();
  reader.open(data, bytes.length);
  const count = reader.getCount(), length = reader.getPointLength(), record = perf._malloc(length);
  const records = Buffer.alloc(Math.ceil(count / every) * length);
  for (let i = 0; i < count; ++i) {
    reader.getPoint(record);  // also of points that are left out: each is stored as a difference from the one before
    if (i % every === 0) records.set(perf.HEAPU8.subarray(record, record + length), i / every * length);
  }
  write({ count, format: reader.getPointFormat(), length }, records);
}

async function readCopc() {
  const { Copc } = require("copc");
  const copc = await Copc.create(file);
  const pages = [copc.info.rootHierarchyPage], views = [];
  while (pages.length) {
    const page = await Copc.loadHierarchyPage(file, pages.pop());
    pages.push(...Object.values(page.pages));
    for (const node of Object.values(page.nodes)) {
      if (node.pointCount) views.push(await Copc.loadPointDataView(file, copc, node));
    }
  }
  const dimensions = Object.keys(views[0].dimensions);
  const values = [];
  for (const view of views) {
    const part = new Float64Array(view.pointCount * dimensions.length);
    dimensions.forEach((name, k) => {
      const get = view.getter(name);
      for (let i = 0; i < view.pointCount; ++i) part[i * dimensions.length + k] = get(i);
    });
    values.push(Buffer.from(part.buffer));
  }
  write({ count: copc.header.pointCount, nodes: views.length, dimensions }, Buffer.concat(values));
}

if (work === "check") {
  await loadE57();
  ["laz-perf", "copc"].forEach(require);
} else if (work === "laz") {
  await readLaz();
} else if (work === "copc") {
  await readCopc();
} else {
  process.stdout.write((await loadE57())(readFileSync(file), "XYZ"));
}
