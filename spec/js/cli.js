#!/usr/bin/env node
/** The command line of this reader; `node cli.js` without arguments says how to use it. */

import { open, readFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { xxh3, xxh3Wide } from "./codecs.js";
import { dump } from "./dump.js";
import { Container, Refused } from "./reader.js";
import { verify } from "./verify.js";

const USAGE = `usage: node cli.js verify FILE [--level N]   check a file; N is 0 to 3, and 3 when it is not given
       node cli.js dump FILE                 print what a file says, as JSON
       node cli.js batch                     do both for each name on standard input, a line of JSON for each
       node cli.js xxh3 TABLE                compare XXH3 with a table such as ../vectors/xxh3.txt`;

/** Exit status of this program. */
const VALID = 0, BROKEN = 1, USED_WRONGLY = 2, SYSTEM = 3;

/** Calls a function with a source over a file, and closes the file and the parts that it names when it is done. */
async function withFile(path, work) {
  const handles = [];
  const sourceOf = async (file) => {
    const handle = await open(file, "r");
    handles.push(handle);
    const stat = await handle.stat();
    if (stat.isDirectory()) throw Object.assign(new Error(`${file} is a folder`), { code: "EISDIR" });
    const read = async (offset, length) => {
      const bytes = new Uint8Array(length);
      const { bytesRead } = await handle.read(bytes, 0, length, offset);
      return bytes.subarray(0, bytesRead);
    };
    const sibling = (name) => sourceOf(join(dirname(file), ...name.split("/"))).catch((error) => {
      if (["ENOENT", "ENOTDIR", "EISDIR"].includes(error.code)) return undefined;
      throw error;
    });
    return { length: stat.size, read, sibling };
  };
  try {
    return await work(await sourceOf(path));
  } finally {
    for (const handle of handles) await handle.close();
  }
}

/** Returns what a function returns, or what a file was refused for. */
async function judged(work) {
  try {
    return { value: await work() };
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    const { rule, offset, page = null, file = null, message: text } = error;
    return { refused: { rule, offset, page, file, text } };
  }
}

/** Opens a file as a partial reader and loads root group, its children's groups, first points and first channels. */
async function openPartly(source) {
  const container = await Container.openPartial(source);
  const s = container.superblock;
  if (s.points === 0) return;
  const root = await container.group(s.rootPage, s.rootSlot);
  for (const child of root.children) if (child.count === undefined) await container.group(child.page, child.slot);
  await container.points(0);
  for (let j = 0; j < s.attributeGroups; j++) await container.attributes(j, 0);
}

/** Judges each file that standard input names, and prints a line of JSON for each. */
async function batch() {
  for await (const path of createInterface({ input: process.stdin })) {
    const line = await withFile(path, async (source) => ({
      path,
      verify: (await judged(() => verify(source))).refused ?? null,
      partial: (await judged(() => openPartly(source))).refused ?? null,
      dump: await judged(() => dump(source)),
    }));
    console.log(JSON.stringify(line));
  }
}

/** Compares XXH3 with every row of a table, and returns how many rows differ. */
async function compareHashes(table) {
  let different = 0;
  for (const row of (await readFile(table, "utf8")).split("\n")) {
    if (row === "" || row.startsWith("#")) continue;
    const [length, seed, narrow, wide] = row.split(" ");
    const bytes = new Uint8Array(Number(length));
    let x = 1n;
    for (let i = 0; i < bytes.length; i++) {
      x = BigInt.asUintN(64, x * 6364136223846793005n + 1442695040888963407n);
      bytes[i] = Number(x >> 56n);
    }
    const number = BigInt("0x" + seed);
    const same = (await xxh3(bytes, number)) === BigInt("0x" + narrow) && (await xxh3Wide(bytes, number)) === wide;
    if (!same) {
      different++;
      console.log(`XXH3 of ${length} bytes, seed ${seed}, is not that of the table`);
    }
  }
  return different;
}

/** Runs a command and returns the exit status. */
async function main([command, path, option, level, ...rest]) {
  const optionIsSound = option === undefined || (command === "verify" && option === "--level" && /^[0-3]$/.test(level));
  if (rest.length > 0 || !optionIsSound || (path === undefined) !== (command === "batch")) return usage();
  switch (command) {
    case "verify":
      await withFile(path, (source) => verify(source, Number(level ?? 3)));
      console.log(`${path}: valid, level ${level ?? 3}`);
      return VALID;
    case "dump":
      console.log(JSON.stringify(await withFile(path, dump), null, 2));
      return VALID;
    case "batch":
      await batch();
      return VALID;
    case "xxh3":
      return (await compareHashes(path)) === 0 ? VALID : BROKEN;
    default:
      return usage();
  }
}

/** Prints how to use the program. */
function usage() {
  console.error(USAGE);
  return USED_WRONGLY;
}

// While WebAssembly compiles, nothing else keeps the event loop alive. Node 20 then waits for its compiler threads, and waits
// for ever when one of them waits for a garbage collection.
const alive = setInterval(() => {}, 2 ** 30);

const args = process.argv.slice(2);
try {
  process.exitCode = await main(args);
} catch (error) {
  console.error(`${error.file ?? args[1] ?? args[0]}: ${error.message}`);
  process.exitCode = error instanceof Refused ? BROKEN : SYSTEM;
} finally {
  clearInterval(alive);
}
