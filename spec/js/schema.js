/** The meta page: channels and texts (spec/points.md#schema). */

import { need } from "./rules.js";
import { allZero, big, isName, textOf, viewOf } from "./values.js";

const CHANNEL_BYTES = 88;

/** Bytes of a component by the number of its type. */
const TYPE_BYTES = { 1: 1, 2: 2, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8 };

/** The typed array that holds values of a type; halves keep their bits. */
const TYPE_ARRAYS = {
  1: Uint8Array, 2: Uint16Array, 3: Uint16Array, 4: Float32Array, 5: Uint32Array, 6: BigUint64Array,
  7: Int8Array, 8: Int16Array, 9: Int32Array, 10: BigInt64Array, 11: Float64Array,
};

/** The typed array that holds values of an unknown type, by the bytes of a component. */
const SIZE_ARRAYS = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array, 8: BigUint64Array };

/**
 * A channel of the schema.
 * @typedef {object} Channel
 * @property {string} name
 * @property {number} type number of the type; beyond the table it is one of a later version
 * @property {number} components
 * @property {number} group channel group, 1 to 255
 * @property {number} role
 * @property {number} colourSpace
 * @property {number} size bytes of a component
 * @property {string} unit empty when there is none
 * @property {bigint|undefined} noValue bits of the value that stands for "not known"
 * @property {number} scale
 * @property {number} offset a component v means v scale + offset
 */

/** Reads and checks the channel at an offset of the payload. */
function readChannel(bytes, view, at, place) {
  const channel = (good, text) => need(good, "points.md#meta-channel", place + at, text);
  const zero = (good, text) => need(good, "points.md#meta-zero", place + at, text);

  // Read name and unit, and the zeros behind them.
  const nameField = bytes.subarray(at, at + 32);
  const nameEnd = nameField.indexOf(0);
  channel(nameEnd > 0 && isName(nameField.subarray(0, nameEnd)), "a channel's name is not a name");
  zero(allZero(nameField, nameEnd), "a byte after a channel's name is set");
  const unitField = bytes.subarray(at + 40, at + 56);
  const unitEnd = unitField.indexOf(0);
  const unit = unitEnd < 0 ? undefined : textOf(unitField.subarray(0, unitEnd));
  channel(unit !== undefined, "a channel's unit is not text of at most 15 bytes");
  zero(allZero(unitField, unitEnd), "a byte after a channel's unit is set");

  // Check the numbers, each by itself and then together.
  const [type, components, group, role, colourSpace, flags, size, reserved] = bytes.subarray(at + 32, at + 40);
  const noValue = big(view, at + 56);
  const scale = view.getFloat64(at + 64, true);
  const offset = view.getFloat64(at + 72, true);
  channel(components >= 1 && components <= 16, `a channel has ${components} components`);
  channel(group >= 1, "a channel's group is 0");
  channel(size in SIZE_ARRAYS, `a component of a channel has ${size} bytes`);
  channel(!(type in TYPE_BYTES) || TYPE_BYTES[type] === size, `type ${type} has not ${size} bytes`);
  channel(Number.isFinite(scale) && scale !== 0, "a channel's scale is 0, infinite or NaN");
  channel(Number.isFinite(offset), "a channel's offset is infinite or NaN");
  channel((role !== 2 && role !== 3) || components === 3, `a channel of role ${role} has not 3 components`);
  channel(role !== 5 || (components === 1 && (type === 5 || type === 6)), "an index is not one u32 or u64");
  zero(flags <= 1 && reserved === 0 && allZero(bytes, at + 80, at + 88), "a reserved bit of a channel is set");
  zero(flags === 1 || noValue === 0n, "a channel without the flag has a no_value");
  channel(noValue < 2n ** BigInt(8 * size), "a channel's no_value does not fit its type");

  const name = textOf(nameField.subarray(0, nameEnd));
  return { name, type, components, group, role, colourSpace, size, unit,
    noValue: flags === 1 ? noValue : undefined, scale, offset };
}

/** Reads and checks the texts from an offset of the payload to its end. */
function readTexts(bytes, view, at, count, place) {
  const size = (good, text) => need(good, "points.md#meta-size", place + at, text);
  const check = (good, text) => need(good, "points.md#meta-text", place + at, text);
  const texts = new Map();
  let before = "";
  for (let i = 0; i < count; i++) {
    // A text is the lengths of its key and of its value, both u32, and then both without padding.
    size(bytes.length - at >= 8, "the meta page ends in a text");
    const keyBytes = view.getUint32(at, true);
    const valueBytes = view.getUint32(at + 4, true);
    size(keyBytes <= bytes.length - at - 8, "the meta page ends in the key of a text");
    size(valueBytes <= bytes.length - at - 8 - keyBytes, "the meta page ends in the value of a text");
    const keyField = bytes.subarray(at + 8, at + 8 + keyBytes);
    const value = textOf(bytes.subarray(at + 8 + keyBytes, at + 8 + keyBytes + valueBytes));
    check(isName(keyField), "the key of a text is not a name");
    const key = textOf(keyField);
    check(key > before, "the keys of texts do not ascend");
    check(value !== undefined, "the value of a text is not well-formed UTF-8 without NUL");
    texts.set(key, value);
    before = key;
    at += 8 + keyBytes + valueBytes;
  }
  size(at === bytes.length, "bytes are left over behind the texts");
  return texts;
}

/** Says whether the value of a text whose form is fixed has that form. */
function factIsSound(key, value) {
  const decimal = /^-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]+)?$/;
  if (key === "up") return /^[xyz]$/.test(value);
  if (key === "time") return decimal.test(value);
  if (key === "metres_per_unit") return decimal.test(value) && /^[0.]*[1-9]/.test(value);
  return true;
}

/**
 * Reads the payload of the meta page.
 * @param {Uint8Array} bytes the payload
 * @param {number} place offset of the payload in the file
 * @param {number} pointBytes bytes of a point, which the channels of one group must not exceed
 * @returns {{channels: Channel[], groups: number[], texts: Map<string, string>}} groups ascend
 */
export function readSchema(bytes, place, pointBytes) {
  const view = viewOf(bytes);
  need(bytes.length >= 8, "points.md#meta-size", place, "the meta page is too short for its counts");
  const channelCount = view.getUint32(0, true);
  const textCount = view.getUint32(4, true);
  need(channelCount <= (bytes.length - 8) / CHANNEL_BYTES, "points.md#meta-size", place,
    `the meta page is too short for ${channelCount} channels`);

  const channels = [];
  const names = new Set();
  const groupBytes = new Map();
  for (let i = 0; i < channelCount; i++) {
    const at = 8 + CHANNEL_BYTES * i;
    const check = (good, text) => need(good, "points.md#meta-channel", place + at, text);
    const channel = readChannel(bytes, view, at, place);
    check(!names.has(channel.name), "two channels have one name");
    check(i === 0 || channel.group >= channels[i - 1].group, "the groups of channels descend");
    const sum = (groupBytes.get(channel.group) ?? 0) + channel.components * channel.size;
    check(sum <= pointBytes, `the channels of group ${channel.group} take more than ${pointBytes} bytes`);
    names.add(channel.name);
    groupBytes.set(channel.group, sum);
    channels.push(channel);
  }
  const texts = readTexts(bytes, view, 8 + CHANNEL_BYTES * channelCount, textCount, place);
  for (const [key, value] of texts) {
    need(factIsSound(key, value), "points.md#meta-fact", place, `the text ${key} has not the form of its key`);
  }
  return { channels, groups: [...groupBytes.keys()], texts };
}

/**
 * Returns the columns of an attribute page: for each channel a typed array for each component.
 * @param {Channel[]} channels the channels of the page's group
 * @param {number} n points of the page
 * @param {Uint8Array|null} payload null for a void page, whose values are no_value or 0
 * @returns {{channel: Channel, columns: ArrayBufferView[]}[]}
 */
export function attributeColumns(channels, n, payload) {
  let at = 0;
  return channels.map((channel) => {
    const columns = [];
    for (let k = 0; k < channel.components; k++) {
      const raw = payload ? payload.slice(at, at + n * channel.size) : voidColumn(channel, n);
      at += n * channel.size;
      columns.push(new (TYPE_ARRAYS[channel.type] ?? SIZE_ARRAYS[channel.size])(raw.buffer));
    }
    return { channel, columns };
  });
}

/** Returns the bytes of a column whose every value is the channel's no_value, or 0 without one. */
function voidColumn(channel, n) {
  const one = new Uint8Array(8);
  viewOf(one).setBigUint64(0, channel.noValue ?? 0n, true);
  const raw = new Uint8Array(n * channel.size);
  for (let i = 0; i < n; i++) raw.set(one.subarray(0, channel.size), i * channel.size);
  return raw;
}
