/** What a file says, as plain values and hashes that other readers can be compared with. */

import { createXXHash3 } from "hash-wasm";
import { Container } from "./reader.js";
import { halfValue, octahedral, rgbeValue, ufloatValue } from "./values.js";

/** Returns the bytes of a typed array. */
function bytesOf(array) {
  return new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
}

/** Returns the values of columns one record after another, as a typed array of another kind. */
function interleave(Type, columns, value = (v) => v) {
  const records = new Type(columns.length * columns[0].length);
  columns.forEach((column, k) => column.forEach((v, i) => {
    records[columns.length * i + k] = value(v, k);
  }));
  return records;
}

/** Returns normals as unit vectors, x, y and z of each point. */
function normalsOf([u, v]) {
  const normals = new Float64Array(3 * u.length);
  u.forEach((value, i) => normals.set(octahedral(value, v[i], 32767), 3 * i));
  return normals;
}

/** Returns area, facing and radiance of a group's nodes: 1 + 6 + 6 * 3 numbers of each. */
function sumsOf(group) {
  return Float64Array.from(group.children.flatMap((_, i) => [
    ufloatValue(group.area[i]),
    ...group.facing.map((column) => column[i] / 65535),
    ...group.radiance.flatMap((column) => rgbeValue(column[i])),
  ]));
}

/** Returns a channel as JSON can hold it. */
function channelOf(channel) {
  const { noValue, ...rest } = channel;
  return { ...rest, noValue: noValue === undefined ? null : "0x" + noValue.toString(16) };
}

/**
 * Opens a file, loads all its pages and returns what it says; points and nodes of a scene are also those of its
 * parts. Hashes are XXH3-64 in hexadecimal over
 * little-endian values, all points or nodes one after another: positions, normals and node sums are f64,
 * radii f32, albedo u8, radiance and emission f32; emission is 0 where a file has none.
 * @param {{length: number, read: Function}} source
 */
export async function dump(source) {
  const container = await Container.open(source);
  const { header, superblock: s, schema } = container;
  const names = ["payloads", "positions", "normals", "radii", "albedo", "radiance", "emission", "nodeSums"];
  const hashes = Object.fromEntries(await Promise.all(names.map(async (name) => [name, await createXXHash3()])));
  Object.values(hashes).forEach((hash) => hash.init());
  const add = (name, array) => hashes[name].update(bytesOf(array));

  for (let n = 0; n < s.pageCount; n++) {
    const payload = await container.payload(n);
    if (payload) {
      add("payloads", payload);
    } else {
      const values = await container.attributes(Math.floor(n / s.pointPages) - 1, n % s.pointPages);
      values.forEach(({ columns }) => columns.forEach((column) => add("payloads", column)));
    }
  }
  for (let rank = 0; rank < container.pointPages; rank++) {
    const points = await container.points(rank);
    add("positions", interleave(Float64Array, points.position, (q, k) => header.origin[k] + q * header.unit));
    add("normals", normalsOf(points.normal));
    add("radii", points.radius);
    add("albedo", interleave(Uint8Array, points.albedo));
    add("radiance", interleave(Float32Array, points.radiance, halfValue));
    const emission = points.emission.length ? points.emission : points.radiance.map((column) => column.map(() => 0));
    add("emission", interleave(Float32Array, emission, halfValue));
  }
  for (let rank = 0; rank < container.nodePages; rank++) {
    for (const group of await container.nodes(rank)) add("nodeSums", sumsOf(group));
  }

  return {
    points: s.points, nodes: s.nodes, groups: s.nodeGroups, levels: s.levels, pages: s.pageCount,
    leafPoints: s.leafPoints, pointBytes: header.pointBytes, pageSize: header.pageSize, writer: s.writer,
    origin: header.origin, edge: header.edge, boundsLow: s.boundsLow, boundsHigh: s.boundsHigh, area: s.area,
    flux: s.flux, digest: s.digest, channels: schema.channels.map(channelOf), texts: Object.fromEntries(schema.texts),
    hashes: Object.fromEntries(names.map((name) => [name, hashes[name].digest("hex")])),
  };
}
