#!/usr/bin/env python3
"""A second reader of PTCX files, laid out like container.md, points.md and nodes.md.

    reader.py FILE [--json]          check FILE whole; exit 0 valid, 1 broken, 2 usage, 3 system
    reader.py --self-test            compare XXH3 with vectors/xxh3.txt
    reader.py --write-vectors DIR    write good/, bad/ and verify/ below DIR

Standard library only; pages compressed with zstd are decoded by the `zstd` program. All rules are
checked but those about the values of summaries (nodes.md#summary). Memory: 24 bytes a point and the
decoded node pages. As a module: open_container(path) gives points() and groups().
"""

import argparse
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from array import array
from collections import namedtuple

from xxh3 import check_table, xxh3_128, xxh3_64

BLOCK, SECTOR = 4096, 512
PAGE_HEADER_BYTES = 64
ENTRY_BYTES = 32
NO_PAGE = 0xFFFFFFFF
NODE, POINT, DIRECTORY, META, ATTRIBUTE = 1, 2, 3, 4, 5
RAW, ZSTD, LZ4 = 0, 1, 2
PACKED = 1  # the filter of packed columns


class Broken(Exception):
    """A rule of the format that the file breaks: where, which, how."""

    def __init__(self, offset, clause, text):
        super().__init__(f"offset {offset}: {text} ({clause})")
        self.offset, self.clause, self.text = offset, clause, text


def require(holds, offset, clause, text):
    if not holds:
        raise Broken(offset, clause, text)


def round_up(n, unit):
    return (n + unit - 1) // unit * unit


# File header (container.md#file-header) ----------------------------------------------------------

FILE_MAGIC = bytes.fromhex("89505443 0d0a1a0a")
HEADER_SEED = int.from_bytes(b"PTCXHEAD", "little")
HEADER = struct.Struct("<8sHHIQQQ16sBBHI3dd24sQ")

Header = namedtuple("Header", "identity major minor uuid page_shift origin edge")


def page_size(header):
    return 1 << header.page_shift


def check_frame_of(origin, edge):  # morton.md#frame
    clause = "spec/container.md#header-frame"
    require(edge > 0 and math.frexp(edge)[0] == 0.5 and 2.0 ** -960 <= edge <= 2.0 ** 1010, 88,
            clause, "edge is not a power of two in range")
    unit = edge * 2.0 ** -42
    for x in origin:
        steps = x / unit
        require(-2.0 ** 53 <= steps <= 2.0 ** 53 - 2.0 ** 42 and steps == math.floor(steps), 64,
                clause, "origin is not a multiple of the unit in range")


def decode_header(block):
    require(block[:8] == FILE_MAGIC, 0, "spec/container.md#header-magic", "not a PTCX file")
    require(len(block) == BLOCK, len(block), "spec/container.md#header-length",
            "file ends in its header")
    (_, major, minor, header_bytes, incompat, _, _, uuid, page_shift, align_shift, checksum,
     byte_order, x, y, z, edge, reserved, found) = HEADER.unpack_from(block)
    require(found == xxh3_64(block[:120], HEADER_SEED), 120, "spec/container.md#header-checksum",
            "file header's checksum is wrong")
    require(major == 1, 8, "spec/container.md#header-version", f"version {major} is not supported")
    require(incompat == 0, 16, "spec/container.md#header-features", "file needs a feature that this program does not know")
    require((header_bytes, align_shift, checksum, byte_order) == (BLOCK, 9, 1, 0x01020304), 12,
            "spec/container.md#header-constants", "a constant has another value")
    require(12 <= page_shift <= 20, 56, "spec/container.md#header-page-shift",
            "page_shift is not 12 to 20")
    check_frame_of((x, y, z), edge)
    require(not any(reserved) and not any(block[128:]), 96, "spec/container.md#header-zero",
            "a reserved byte is not zero")
    return Header(block[8:120], major, minor, uuid, page_shift, (x, y, z), edge)


# Page header (container.md#page-header) ----------------------------------------------------------

PAGE = struct.Struct("<4sHBBIIIHHIIQQQQ")

Page = namedtuple("Page", "type codec filter page_id stored_bytes raw_bytes group level record_count "
                          "first_key last_key payload_xxh3")


def page_seed(uuid, page_id, type_):
    return xxh3_64(uuid + struct.pack("<IH", page_id, type_))


def check_facts(header, at, type_, group, stored, raw, count):
    """The rules that page headers and directory entries share."""
    fields = "spec/container.md#page-fields"
    require(NODE <= type_ <= ATTRIBUTE, at, "spec/container.md#page-type", "unknown page type")
    require(1 <= raw <= page_size(header) - PAGE_HEADER_BYTES and 1 <= stored <= raw, at,
            "spec/container.md#page-length", "stored_bytes or raw_bytes is out of range")
    require(1 <= group <= 255 if type_ == ATTRIBUTE else group == 0, at, fields,
            "group does not suit the page's type")
    suits = {NODE: count <= 0xFFFF, POINT: raw == POINT_BYTES * count,
             DIRECTORY: raw == ENTRY_BYTES * count, META: count == 1, ATTRIBUTE: True}
    require(count >= 1 and suits[type_], at, fields, "record_count does not suit the page")


def decode_page_header(header, bytes_, at):
    magic, *fields, found = PAGE.unpack(bytes_)
    require(magic == b"PTCp", at, "spec/container.md#page-magic", "no page starts here")
    (type_, codec, filter_, page_id, stored, raw, group, level, count, reserved, first, last,
     hash_) = fields
    require(found == xxh3_64(bytes_[:56], page_seed(header.uuid, page_id, type_)), at + 56,
            "spec/container.md#page-checksum", "page header's checksum is wrong")
    check_facts(header, at, type_, group, stored, raw, count)
    require(codec <= (RAW if type_ == DIRECTORY else LZ4), at + 6,
            "spec/container.md#page-codec", "unknown codec, or a compressed directory page")
    require(filter_ <= (PACKED if type_ in (POINT, ATTRIBUTE) and codec != RAW else 0), at + 7,
            "spec/container.md#page-filter", "unknown filter, or one that suits no such page")
    require((codec == RAW) == (stored == raw), at + 12, "spec/container.md#page-length",
            "stored_bytes equals raw_bytes without codec raw, or differs with codec raw")
    require(reserved == 0 and (level <= 62 if type_ == NODE else level == 0xFFFF), at + 22,
            "spec/container.md#page-fields", "level or the reserved field is out of range")
    limit = 1 if type_ in (DIRECTORY, META) else 1 << 63
    require(first <= last < limit, at + 32, "spec/container.md#page-keys", "keys are out of range")
    return Page(type_, codec, filter_, page_id, stored, raw, group, level, count, first, last, hash_)


# Codecs (container.md#codecs) --------------------------------------------------------------------

FRAME = "spec/container.md#codec-frame"
LZ4_BLOCK = "spec/container.md#codec-block"


def check_size(page, size, at, clause):
    """What a codec decodes to: the payload, or packed columns that are no longer."""
    require(1 <= size <= page.raw_bytes and (page.filter == PACKED or size == page.raw_bytes), at,
            clause, "another content size than the page's")
    return size


def check_frame(stored, page, at):
    """The content size of one zstd frame with a single segment (RFC 8878, section 3.1.1)."""
    require(stored[:4] == b"\x28\xb5\x2f\xfd" and len(stored) >= 6, at, FRAME, "not a zstd frame")
    descriptor = stored[4]
    require(descriptor & 0x20 and not descriptor & 0x0B, at + 4, FRAME,
            "not a single segment, or a dictionary, or a reserved bit")
    size_bytes = (1, 2, 4, 8)[descriptor >> 6]
    size = int.from_bytes(stored[5:5 + size_bytes], "little") + (256 if size_bytes == 2 else 0)
    check_size(page, size, at + 5, FRAME)
    end, last = 5 + size_bytes, False
    while not last:
        require(end + 3 <= len(stored), at + end, FRAME, "frame is truncated")
        block = int.from_bytes(stored[end:end + 3], "little")
        last, kind, length = block & 1, block >> 1 & 3, block >> 3
        end += 3 + (1 if kind == 1 else length)  # one byte repeated, or as many as it says
    end += 4 if descriptor & 0x04 else 0
    require(end == len(stored), at, FRAME, "not exactly one frame")
    return size


def decode_lz4(stored, page, at):
    """One LZ4 block behind its decoded size."""
    require(len(stored) > 4, at, LZ4_BLOCK, "too short for a block")
    size = check_size(page, int.from_bytes(stored[:4], "little"), at, LZ4_BLOCK)
    out, i, whole = bytearray(), 4, False
    begin = end = 0  # of the last match

    def byte():
        nonlocal i
        require(i < len(stored), at + i, LZ4_BLOCK, "block is truncated")
        i += 1
        return stored[i - 1]

    def length(nibble):
        total, more = nibble, nibble == 15
        while more:
            part = byte()
            total, more = total + part, part == 255
        return total
    while not whole:
        token = byte()
        literals = length(token >> 4)
        require(literals <= len(stored) - i, at + i, LZ4_BLOCK, "literals are truncated")
        out += stored[i:i + literals]
        i += literals
        whole = i == len(stored)
        if not whole:
            back = byte() | byte() << 8
            require(1 <= back <= len(out), at + i, LZ4_BLOCK, "match before the start")
            count = length(token & 15) + 4
            begin, end = len(out), len(out) + count
            require(end <= size, at + i, LZ4_BLOCK, "longer than it declares")
            for _ in range(count):
                out.append(out[-back])
    require(len(out) == size, at, LZ4_BLOCK, "another size than it declares")
    require(end == 0 or end <= size - 5 and begin <= size - 12, at, LZ4_BLOCK,
            "the last match ends in the last 5 bytes or begins in the last 12")
    return bytes(out)


def run_zstd(frames, size):
    """What frames decode to, unless it is not `size` bytes; no more of it is taken."""
    with tempfile.TemporaryFile() as file:
        file.write(frames)
        file.seek(0)
        with subprocess.Popen(["zstd", "-dcq"], stdin=file, stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL) as zstd:
            out = zstd.stdout.read(size + 1)
    return out if zstd.returncode == 0 and len(out) == size else None


def decode_frames(jobs):
    """What (page, frame, decoded size, offset) decode to: one process for all, unless one is broken."""
    whole = run_zstd(b"".join(stored for _, stored, _, _ in jobs), sum(raw for _, _, raw, _ in jobs))
    if whole is not None:
        out, at = {}, 0
        for page, _, raw, _ in jobs:
            out[page], at = whole[at:at + raw], at + raw
        return out
    for _, stored, raw, at in jobs:
        require(run_zstd(stored, raw) is not None, at, FRAME, "frame does not decode")
    raise Broken(jobs[0][3], FRAME, "frames do not decode together")


# Directory (container.md#directory) --------------------------------------------------------------

ENTRY = struct.Struct("<QIIQHHI")

Entry = namedtuple("Entry", "offset stored_bytes raw_bytes payload_xxh3 type group record_count")


def entries_per_page(header):
    return (page_size(header) - PAGE_HEADER_BYTES) // ENTRY_BYTES


def directory_bytes(header, pages):
    full, rest = divmod(pages, entries_per_page(header))
    return full * page_size(header) + (round_up(64 + ENTRY_BYTES * rest, BLOCK) if rest else 0)


def extent_bytes(entry):
    return round_up(PAGE_HEADER_BYTES + entry.stored_bytes, SECTOR)


def decode_entry(header, bytes_, file_bytes, at):
    entry = Entry(*ENTRY.unpack(bytes_))
    check_facts(header, at, entry.type, entry.group, entry.stored_bytes, entry.raw_bytes,
                entry.record_count)
    require(entry.type != DIRECTORY, at + 24, "spec/container.md#directory-listing",
            "directory lists itself")
    require(entry.offset % SECTOR == 0 and entry.offset >= BLOCK
            and entry.offset + extent_bytes(entry) <= file_bytes - 2 * BLOCK, at,
            "spec/container.md#directory-extent", "page lies outside the file's pages")
    return entry


# Superblock (container.md#superblock) ------------------------------------------------------------

SUPER_MAGIC = b"PTCXSUPR"
SUPER_SEED = int.from_bytes(SUPER_MAGIC, "little")
SUPER = struct.Struct("<8s112sQIIQQIIHHIIIQQQ32s3d3dd3d2Q64s3696sQ")

Superblock = namedtuple(
    "Superblock", "magic identity file_bytes page_count directory_pages directory_offset "
    "directory_xxh3 meta_page root_page root_slot levels leaf_points points_per_page reserved "
    "points nodes node_groups middle bounds_low bounds_high area flux content_xxh3 writer "
    "rest xxh3")


def unpack_superblock(block):
    f = SUPER.unpack(block)
    return Superblock(*f[:18], f[18:21], f[21:24], f[24], f[25:28], f[28:30], *f[30:])


def is_text(bytes_):
    try:
        return "\0" not in bytes_.decode("utf-8")
    except UnicodeDecodeError:
        return False


def check_counts(header, s, at):
    counts, root = "spec/container.md#superblock-counts", "spec/container.md#superblock-root"
    empty = s.points == 0
    require(max(s.points, s.nodes) <= 1 << 48 and s.node_groups <= s.nodes, at + 176, counts,
            "points, nodes or node_groups is out of range")
    require(empty == (s.nodes == 0) == (s.node_groups == 0), at + 176, counts,
            "nodes without points or points without nodes")
    least = 0 if empty else 1
    require(least <= s.leaf_points <= 0xFFFF, at + 164, counts, "leaf_points is out of range")
    require(least <= s.points_per_page <= points_per_page(header), at + 168, counts,
            "points_per_page is out of range")
    require((s.root_page, s.root_slot) == (NO_PAGE, 0) if empty else s.root_page < s.page_count,
            at + 156, root, "root_page is no page, or not absent in an empty file")
    require(least <= s.levels <= (0 if empty else 63), at + 162, root, "levels is out of range")


def decode_superblock(header, block, file_bytes, at):
    require(len(block) == BLOCK and block[:8] == SUPER_MAGIC, at,
            "spec/container.md#superblock-magic", "no superblock: unfinished or truncated")
    s = unpack_superblock(block)
    require(s.xxh3 == xxh3_64(block[:4088], SUPER_SEED), at + 4088,
            "spec/container.md#superblock-checksum", "superblock's checksum is wrong")
    require(s.identity == header.identity, at + 8, "spec/container.md#superblock-header",
            "superblock repeats another file header")
    require(s.file_bytes == file_bytes and file_bytes % BLOCK == 0, at + 120,
            "spec/container.md#superblock-length",
            f"file has {file_bytes} bytes, its superblock says {s.file_bytes}")
    pages = "spec/container.md#superblock-pages"
    require(1 <= s.page_count < NO_PAGE, at + 128, pages, "page_count is out of range")
    require(s.directory_pages == (s.page_count - 1) // entries_per_page(header) + 1, at + 132,
            pages, "directory_pages does not suit page_count")
    require(s.directory_offset % BLOCK == 0 and s.directory_offset >= BLOCK
            and s.directory_offset + directory_bytes(header, s.page_count)
            == file_bytes - 2 * BLOCK, at + 136, pages, "directory does not end at superblock A")
    require(s.meta_page < s.page_count, at + 152, pages, "meta_page is no page")
    check_counts(header, s, at)
    totals = "spec/container.md#superblock-totals"
    require(all(map(math.isfinite, s.bounds_low + s.bounds_high))
            and all(a <= b for a, b in zip(s.bounds_low, s.bounds_high)), at + 232, totals,
            "bounds are not finite or not ordered")
    require(all(math.isfinite(x) and x >= 0 for x in (s.area, *s.flux)), at + 280, totals,
            "area or flux is not finite or negative")
    text, _, rest = s.writer.partition(b"\0")
    require(len(text) < 64 and is_text(text) and not any(rest), at + 328,
            "spec/container.md#superblock-writer", "writer is not text followed by zeros")
    require(s.reserved == 0 and not any(s.middle) and not any(s.rest), at + 172, "spec/container.md#superblock-zero",
            "a reserved byte is not zero")
    return s


# Lattice, Z-curve and frame (morton.md) ----------------------------------------------------------

SPREAD = array("Q", (sum((i >> b & 1) << 3 * b for b in range(14)) for i in range(1 << 14)))


def interleave(x, y, z):
    """126-bit key of a lattice point: 14 bits of each coordinate at a time."""
    s, m = SPREAD, 0x3FFF
    return ((s[x >> 28] | s[y >> 28] << 1 | s[z >> 28] << 2) << 84
            | (s[x >> 14 & m] | s[y >> 14 & m] << 1 | s[z >> 14 & m] << 2) << 42
            | s[x & m] | s[y & m] << 1 | s[z & m] << 2)


def to_position(header, q):
    unit = header.edge * 2.0 ** -42
    return tuple(o + c * unit for o, c in zip(header.origin, q))


# Points (points.md) ------------------------------------------------------------------------------

POINT_BYTES = 34
CHANNEL_BYTES = {1: 1, 2: 2, 3: 2, 4: 4}
NAME_BYTES = frozenset(b"abcdefghijklmnopqrstuvwxyz0123456789_.")

Channel = namedtuple("Channel", "name type components group")
Meta = namedtuple("Meta", "channels text")


def points_per_page(header):
    return (page_size(header) - PAGE_HEADER_BYTES) // POINT_BYTES // 8 * 8


class Points:
    """The columns of a point page, every value checked."""

    def __init__(self, payload, count, at):
        require(count >= 1 and len(payload) == POINT_BYTES * count, at,
                "spec/points.md#point-size", "payload does not have 34 bytes a point")
        self.count = count

        def column(form, before):
            return struct.unpack_from(f"<{count}{form}", payload, before * count)

        high = column("I", 12)
        require(max(high) < 1 << 30, at + 12 * count, "spec/points.md#point-lattice",
                "bits 30 and 31 of high are not zero")
        self.x, self.y, self.z = ([low | (top >> shift & 1023) << 32
                                   for low, top in zip(column("I", before), high)]
                                  for before, shift in ((0, 0), (4, 10), (8, 20)))
        self.keys = list(map(interleave, self.x, self.y, self.z))
        for i in range(1, count):
            if self.keys[i - 1] > self.keys[i]:
                raise Broken(at + 4 * i, "spec/points.md#point-order",
                             f"point {i} precedes the point before it")
        require(max(column("I", 16)) < 0x7F800000, at + 16 * count,
                "spec/points.md#point-radius", "a radius is negative or not finite")
        require(max(column("H", 24) + column("H", 26) + column("H", 28)) < 0x7C00,
                at + 24 * count, "spec/points.md#point-radiance",
                "radiance is negative or not finite")
        require(not any(payload[33 * count:]), at + 33 * count, "spec/points.md#point-flags",
                "flags are not zero")
        self.radius = column("f", 16)
        self.normal = list(zip(column("h", 20), column("h", 22)))
        self.radiance = tuple(column("e", before) for before in (24, 26, 28))
        self.albedo = tuple(column("B", before) for before in (30, 31, 32))


Column = namedtuple("Column", "before bits minus")
COLUMN_FORM = {8: "B", 16: "H", 32: "I", 42: "I"}  # by bits, as payloads hold them
POINT_COLUMNS = [Column(0, 42, None), Column(4, 42, None), Column(8, 42, None),
                 Column(16, 32, None), Column(20, 16, None), Column(22, 16, None),
                 Column(26, 16, None), Column(24, 16, 6), Column(28, 16, 6),
                 Column(31, 8, None), Column(30, 8, 9), Column(32, 8, 9), Column(33, 8, None)]


def group_columns(channels, group):
    out, before = [], 0
    for c in channels:
        for _ in range(c.components if c.group == group else 0):
            out.append(Column(before, 8 * CHANNEL_BYTES[c.type], None))
            before += CHANNEL_BYTES[c.type]
    return out


def unpack_columns(packed, columns, count, at):
    """The payload that packed columns stand for (points.md#packed-columns)."""
    clause, place, values = "spec/points.md#packed-columns", 0, []
    for column in columns:
        require(len(packed) - place >= 10, at, clause, "a column's head is truncated")
        shift, planes, value = struct.unpack_from("<BBQ", packed, place)
        mask = (1 << column.bits) - 1
        require(shift < column.bits and planes <= (column.bits + 7) // 8 and value <= mask, at,
                clause, "shift, planes or base is out of range")
        end = place + 10 + planes * count
        require(end <= len(packed), at, clause, "a plane is truncated")
        out = []
        for i in range(count):
            code = sum(packed[place + 10 + k * count + i] << 8 * k for k in range(planes))
            value = value + ((code >> 1 ^ -(code & 1)) << shift) & mask
            out.append(value)
        if column.minus is not None:
            out = [a + b & mask for a, b in zip(out, values[column.minus])]
        values.append(out)
        place = end
    require(place == len(packed), at, clause, "bytes follow the last column")
    parts = {}
    for column, numbers in zip(columns, values):
        form = COLUMN_FORM[column.bits]
        parts[column.before] = struct.pack(f"<{count}{form}", *(v & 0xFFFFFFFF for v in numbers))
    if columns is POINT_COLUMNS:
        parts[12] = struct.pack(f"<{count}I", *(x >> 32 | y >> 32 << 10 | z >> 32 << 20
                                                for x, y, z in zip(*values[:3])))
    return b"".join(parts[before] for before in sorted(parts))


def is_name(bytes_):
    return 1 <= len(bytes_) <= 31 and NAME_BYTES.issuperset(bytes_)


def group_bytes(channels, group):
    return sum(CHANNEL_BYTES[c.type] * c.components for c in channels if c.group == group)


def decode_channel(payload, at, base, earlier):
    name, type_, components, group, reserved = struct.unpack_from("<32sBBHI", payload, at)
    name, _, rest = name.partition(b"\0")
    require(not any(rest) and reserved == 0, base + at, "spec/points.md#meta-zero",
            "a channel's reserved byte is not zero")
    clause = "spec/points.md#meta-channel"
    require(is_name(name) and all(c.name != name.decode() for c in earlier), base + at, clause,
            "channel's name is no name or not unique")
    require(type_ in CHANNEL_BYTES and 1 <= components <= 16 and 1 <= group <= 255
            and (not earlier or earlier[-1].group <= group), base + at + 32, clause,
            "channel's type, components or group is out of range")
    channel = Channel(name.decode(), type_, components, group)
    require(group_bytes([*earlier, channel], group) <= POINT_BYTES, base + at, clause,
            "channels of one group take more than 34 bytes a point")
    return channel


def decode_meta(payload, base):
    size = "spec/points.md#meta-size"
    require(len(payload) >= 8, base, size, "meta page is truncated")
    channel_count, text_count = struct.unpack_from("<II", payload)
    require(channel_count <= (len(payload) - 8) // 40, base, size, "channels are truncated")
    channels, text, at = [], {}, 8 + 40 * channel_count
    for i in range(channel_count):
        channels.append(decode_channel(payload, 8 + 40 * i, base, channels))
    last = b""
    for _ in range(text_count):
        require(len(payload) - at >= 8, base + at, size, "text is truncated")
        key_bytes, value_bytes = struct.unpack_from("<II", payload, at)
        require(key_bytes + value_bytes <= len(payload) - at - 8, base + at, size,
                "text is truncated")
        key = payload[at + 8:at + 8 + key_bytes]
        value = payload[at + 8 + key_bytes:at + 8 + key_bytes + value_bytes]
        require(is_name(key) and key > last and is_text(value), base + at,
                "spec/points.md#meta-text", "key is no name or out of order, or value is no text")
        text[key.decode()], last, at = value.decode(), key, at + 8 + key_bytes + value_bytes
    require(at == len(payload), base + at, size, "bytes follow the last text")
    return Meta(channels, text)


# Nodes (nodes.md) --------------------------------------------------------------------------------

Child = namedtuple("Child", "interior page slot first count")
Group = namedtuple("Group", "cell level children at")
COLUMNS = ("mean_x", "mean_y", "mean_z", "radius", "cone_axis", "cone_cos", "area", "thickness")


def cell_of(key, level):
    shift = 3 * (42 - min(level, 42))
    return key >> shift << shift


def decode_ref(word, interior, pages, points, at):
    if interior:
        require(word >> 48 == 0, at, "spec/nodes.md#node-zero", "reserved bits are not zero")
        require(word & 0xFFFFFFFF < pages, at, "spec/nodes.md#node-reference",
                "child's page does not exist")
        return Child(True, word & 0xFFFFFFFF, word >> 32, 0, 0)
    first, count = word & (1 << 48) - 1, word >> 48
    require(count >= 1 and first + count <= points, at, "spec/nodes.md#node-leaf",
            "leaf's points do not exist")
    return Child(False, 0, 0, first, count)


def decode_group(payload, at, base, pages, points):
    """The group at `at` and the number of bytes it takes."""
    here = base + at
    require(len(payload) - at >= 24, here, "spec/nodes.md#node-slots", "group is truncated")
    high, low, level, n, mask, zero, zeros = struct.unpack_from("<QQBBBBI", payload, at)
    require(1 <= n <= 8, here + 17, "spec/nodes.md#node-children", "group does not have 1 to 8 children")
    end = at + 24 + 60 * n
    size = round_up(end - at, 8)
    require(size <= len(payload) - at, here, "spec/nodes.md#node-slots", "group is truncated")
    require(level <= 62, here + 16, "spec/nodes.md#node-level", "level is above 62")
    cell = high << 63 | low
    require(max(high, low) < 1 << 63 and cell_of(cell, level) == cell, here,
            "spec/nodes.md#node-cell", "cell has digits after its level's")
    require(mask >> n == 0, here + 18, "spec/nodes.md#node-mask", "interior names no child")
    column = at + 24 + 8 * n
    require(zero == zeros == 0 and not any(payload[end:at + size]), here + 19,
            "spec/nodes.md#node-zero", "a reserved field is not zero")
    words = struct.unpack_from(f"<{n}Q", payload, at + 24)
    children = [decode_ref(word, mask >> i & 1, pages, points, here + 24 + 8 * i)
                for i, word in enumerate(words)]
    for name, before in (("radius", 6 * n), ("area", 12 * n), ("thickness", 14 * n)):
        require(max(struct.unpack_from(f"<{n}H", payload, column + before)) < 0xFF00,
                base + column + before, "spec/nodes.md#node-number", f"{name} is not finite")
    return Group(cell, level, children, at), size


def decode_groups(payload, count, base, pages, points):
    slots = "spec/nodes.md#node-slots"
    at = round_up(2 * count, 8)
    require(count >= 1 and at <= len(payload), base, slots, "slot table is truncated")
    require(not any(payload[2 * count:at]), base + 2 * count, "spec/nodes.md#node-zero",
            "padding is not zero")
    groups = []
    for slot in range(count):
        require(8 * int.from_bytes(payload[2 * slot:2 * slot + 2], "little") == at,
                base + 2 * slot, slots, "group does not start where the group before it ends")
        group, size = decode_group(payload, at, base, pages, points)
        groups.append(group)
        at += size
    require(at == len(payload), base + at, slots, "bytes follow the last group")
    return groups


def half_to_float(bits):
    return struct.unpack("<e", struct.pack("<H", bits))[0]


def summary(payload, group, i):
    """Columns of child i of a group, as they are stored."""
    n = len(group.children)
    at = group.at + 24 + 8 * n
    out = {name: struct.unpack_from("<H", payload, at + 2 * n * k + 2 * i)[0]
           for k, name in enumerate(COLUMNS)}
    out["facing"] = struct.unpack_from(f"<{6 * n}H", payload, at + 16 * n)[i::n]
    out["radiance"] = struct.unpack_from(f"<{6 * n}I", payload, at + 28 * n)[i::n]
    return out


# Opening (container.md#opening) ------------------------------------------------------------------

class Container:
    """A file whose header, superblock, directory and meta page are right."""

    def __init__(self, path):
        self.file = open(path, "rb")
        try:
            self.open()
        except Broken:
            self.close()
            raise

    def open(self):
        self.file_bytes = os.fstat(self.file.fileno()).st_size
        self.has_zstd = shutil.which("zstd") is not None
        self.header = decode_header(self.read(0, min(BLOCK, self.file_bytes)))
        self.superblock = self.choose_superblock()
        self.entries = self.read_directory()
        self.check_structure()
        s = self.superblock
        loaded = self.load([s.meta_page])
        self.meta = Meta([], {})
        if s.meta_page in loaded:
            self.meta = decode_meta(loaded[s.meta_page],
                                    self.entries[s.meta_page].offset + PAGE_HEADER_BYTES)
            self.check_attribute_pages()

    def close(self):
        self.file.close()

    def read(self, offset, size):
        self.file.seek(offset)
        data = self.file.read(size)
        if len(data) != size:
            raise OSError(f"short read at {offset}")
        return data

    def superblock_copies(self):
        at = max(self.file_bytes - 2 * BLOCK, 0)
        for offset in (at, at + BLOCK):
            block = self.read(offset, min(BLOCK, max(self.file_bytes - offset, 0)))
            try:
                yield block, decode_superblock(self.header, block, self.file_bytes, offset)
            except Broken as error:
                yield block, error

    def choose_superblock(self):
        (block_a, a), (block_b, b) = self.superblock_copies()
        whole = [s for s in (a, b) if isinstance(s, Superblock)]
        if not whole:
            self.look_for_superblock()
            raise b if block_b[:8] == SUPER_MAGIC and block_a[:8] != SUPER_MAGIC else a
        require(len(whole) == 1 or block_a == block_b, self.file_bytes - 2 * BLOCK,
                "spec/container.md#superblock-copies", "the two superblocks differ")
        return whole[0]

    def look_for_superblock(self):
        """One that is whole near the end of a file tells that the file is longer or shorter than it was."""
        blocks = self.file_bytes // BLOCK
        for at in range(BLOCK * max(blocks - 256, 0), BLOCK * blocks, BLOCK):
            for length in (at + BLOCK, at + 2 * BLOCK):
                try:
                    decode_superblock(self.header, self.read(at, BLOCK), length, at)
                except Broken:
                    continue
                raise Broken(self.file_bytes, "spec/container.md#superblock-length",
                             f"file has {self.file_bytes} bytes, its superblock says {length}")

    def entry_at(self, page):
        """Where the directory entry of a page lies in the file."""
        k, i = divmod(page, entries_per_page(self.header))
        return (self.superblock.directory_offset + k * page_size(self.header)
                + PAGE_HEADER_BYTES + i * ENTRY_BYTES)

    def read_directory(self):
        s, clause = self.superblock, "spec/container.md#directory-pages"
        parts = []
        for k in range(s.directory_pages):
            at = s.directory_offset + k * page_size(self.header)
            page = decode_page_header(self.header, self.read(at, PAGE_HEADER_BYTES), at)
            count = min(entries_per_page(self.header),
                        s.page_count - k * entries_per_page(self.header))
            require((page.type, page.page_id, page.record_count)
                    == (DIRECTORY, s.page_count + k, count), at, clause,
                    "not the directory page that belongs here")
            parts.append(self.read(at + PAGE_HEADER_BYTES, page.raw_bytes))
            require(xxh3_64(parts[-1]) == page.payload_xxh3, at + PAGE_HEADER_BYTES, clause,
                    "payload's checksum is wrong")
        whole = b"".join(parts)
        require(xxh3_64(whole) == s.directory_xxh3, s.directory_offset, clause,
                "entries' checksum is not the superblock's")
        return [decode_entry(self.header, whole[i * ENTRY_BYTES:(i + 1) * ENTRY_BYTES],
                             self.file_bytes, self.entry_at(i)) for i in range(s.page_count)]

    def pages_of(self, type_, group=0):
        return [i for i, e in enumerate(self.entries) if (e.type, e.group) == (type_, group)]

    def check_structure(self):
        s, end = self.superblock, BLOCK
        tail = self.file_bytes - 2 * BLOCK
        for page in sorted(range(s.page_count), key=lambda i: self.entries[i].offset):
            entry = self.entries[page]
            end, start = entry.offset + extent_bytes(entry), end
            require(start <= entry.offset and end <= s.directory_offset, self.entry_at(page),
                    "spec/container.md#directory-overlap", f"page {page} overlaps another")
        require(self.pages_of(META) == [s.meta_page], tail, "spec/container.md#meta-page",
                "meta_page is not the one page of type meta")
        counts = "spec/container.md#superblock-counts"
        self.point_pages, self.node_pages = self.pages_of(POINT), self.pages_of(NODE)
        require(s.points == sum(self.entries[i].record_count for i in self.point_pages), tail,
                counts, "directory has another number of points")
        require(s.node_groups == sum(self.entries[i].record_count for i in self.node_pages), tail,
                counts, "directory has another number of groups")
        require(s.nodes <= 8 * s.node_groups, tail, counts, "more than 8 nodes a group")
        if s.points:
            root = self.entries[s.root_page]
            require(root.type == NODE and s.root_slot < root.record_count, tail,
                    "spec/container.md#superblock-root", "root group is in no node page")
        records = b"".join(struct.pack("<HHIQ", e.type, e.group, e.record_count, e.payload_xxh3)
                           for e in self.entries)
        require(xxh3_128(records) == s.content_xxh3, tail, "spec/container.md#superblock-digest",
                "content digest is not that of the directory")
        full, clause = points_per_page(self.header), "spec/points.md#point-pages"
        require(not s.points or s.points_per_page == full, tail, clause,
                "points_per_page is not what a page holds")
        for page in self.point_pages[:-1]:
            require(self.entries[page].record_count == full, self.entry_at(page), clause,
                    f"page {page} is not full")
        require(not s.points or self.entries[self.point_pages[-1]].record_count <= full, tail,
                clause, "the last point page is too full")

    def check_attribute_pages(self):
        clause = "spec/points.md#attribute-pages"
        groups = {c.group for c in self.meta.channels}
        for page, entry in enumerate(self.entries):
            require(entry.type != ATTRIBUTE or entry.group in groups, self.entry_at(page), clause,
                    f"page {page} belongs to no channel")
        for group in groups:
            pages = self.pages_of(ATTRIBUTE, group)
            require(len(pages) == len(self.point_pages), self.file_bytes - 2 * BLOCK, clause,
                    f"group {group} has not a page for each point page")
            for page, beside in zip(pages, self.point_pages):
                entry, count = self.entries[page], self.entries[beside].record_count
                require(entry.record_count == count and
                        entry.raw_bytes == count * group_bytes(self.meta.channels, group),
                        self.entry_at(page), clause, f"page {page} does not suit its points")

    def load(self, pages):
        """Payloads of pages, verified and decoded; without zstd only of those that are raw."""
        out, jobs = {}, []
        self.headers = {}
        for i in pages:
            entry = self.entries[i]
            at = entry.offset
            image = self.read(at, PAGE_HEADER_BYTES + entry.stored_bytes)
            page = decode_page_header(self.header, image[:PAGE_HEADER_BYTES], at)
            require(page.page_id == i and entry == Entry(
                at, page.stored_bytes, page.raw_bytes, page.payload_xxh3, page.type, page.group,
                page.record_count), at, "spec/container.md#page-agreement",
                f"page header is not what the directory says of page {i}")
            stored = image[PAGE_HEADER_BYTES:]
            require(xxh3_64(stored) == page.payload_xxh3, at + PAGE_HEADER_BYTES,
                    "spec/container.md#page-payload", "payload's checksum is wrong")
            self.headers[i] = page
            if page.codec == RAW:
                out[i] = stored
                continue
            if page.codec == LZ4:
                out[i] = decode_lz4(stored, page, at + PAGE_HEADER_BYTES)
                continue
            size = check_frame(stored, page, at + PAGE_HEADER_BYTES)
            jobs.append((i, stored, size, at + PAGE_HEADER_BYTES))
        if jobs and self.has_zstd:
            out.update(decode_frames(jobs))
        for i, payload in out.items():
            if self.headers[i].filter == PACKED:
                out[i] = self.unpack(self.headers[i], payload)
        return out

    def unpack(self, page, packed):
        columns = POINT_COLUMNS if page.type == POINT else group_columns(self.meta.channels,
                                                                         page.group)
        return unpack_columns(packed, columns, page.record_count, self.payload_at(page.page_id))

    def payload_at(self, page):
        return self.entries[page].offset + PAGE_HEADER_BYTES

    def points(self):
        """Point pages in order: Points with columns x, y, z, keys, radius, normal, ..."""
        for page in self.point_pages:
            payload = self.load([page])[page]
            yield Points(payload, self.entries[page].record_count, self.payload_at(page))

    def groups(self, page):
        """The groups of a node page and its payload, for summary()."""
        payload = self.load([page])[page]
        s = self.superblock
        return decode_groups(payload, self.entries[page].record_count, self.payload_at(page),
                             s.page_count, s.points), payload


def open_container(path):
    """Opens a container. Raises Broken or OSError."""
    return Container(path)


# The program -------------------------------------------------------------------------------------

def print_verdict(path, facts):
    print(f"{path}: {facts['points']} points, {facts['nodes']} nodes in {facts['groups']} groups "
          f"on {facts['levels']} levels, {facts['pages']} pages, {facts['bytes']} bytes")
    print(f"{path}: content {facts['content']}")
    if facts["undecoded_pages"]:
        print(f"{path}: no zstd program found: the checksums of {facts['undecoded_pages']} "
              "compressed pages are right, what they hold was not checked")
    else:
        print(f"{path}: valid")


def main():
    parser = argparse.ArgumentParser(description="Check a PTCX file whole.")
    parser.add_argument("file", nargs="?")
    parser.add_argument("--json", action="store_true", help="print the verdict for machines")
    parser.add_argument("--self-test", action="store_true", help="compare XXH3 with its table")
    parser.add_argument("--write-vectors", metavar="DIR", help="write the vectors below DIR")
    options = parser.parse_args()
    if options.self_test:
        table = os.path.join(os.path.dirname(os.path.abspath(__file__)), "vectors", "xxh3.txt")
        print(check_table(table), "hashes agree")
        return 0
    if options.write_vectors:
        import vectors
        return vectors.write_all(options.write_vectors)
    if options.file is None:
        parser.error("no FILE")
    from verifier import verify
    try:
        facts = verify(options.file)
    except Broken as error:
        if options.json:
            print(json.dumps({"valid": False, "offset": error.offset, "clause": error.clause,
                              "text": error.text}))
        else:
            print(f"{options.file}: {error}")
        return 1
    except OSError as error:
        print(f"{options.file}: {error}", file=sys.stderr)
        return 3
    print(json.dumps(facts)) if options.json else print_verdict(options.file, facts)
    return 0


if __name__ == "__main__":
    import reader  # one module, whoever imports it
    sys.exit(reader.main())
