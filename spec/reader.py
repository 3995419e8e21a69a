#!/usr/bin/env python3
"""A second reader of PTCX files, laid out like container.md, points.md, nodes.md and parts.md.

    reader.py FILE [--json]          check FILE whole; exit 0 valid, 1 broken, 2 usage, 3 system
    reader.py --self-test            compare XXH3 with vectors/xxh3.txt
    reader.py --write-vectors DIR    write good/, bad/ and verify/ below DIR

Standard library only; pages compressed with zstd are decoded by the `zstd` program. All rules are
checked but those about the values of summaries (nodes.md#summary). Memory: 24 bytes a point and the
decoded node pages. As a module: open_container(path) gives points() and groups(); of a scene of
parts these are those of the parts as well.
"""

import argparse
import bisect
import json
import math
import os
import re
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
ENTRY_BYTES = 40
NO_PAGE = 0xFFFFFFFF
NO_LEVEL = 0xFF
NODE, POINT, DIRECTORY, META, ATTRIBUTE, PARTS = 1, 2, 3, 4, 5, 6
SKIPPABLE = 128  # the first page type that readers pass over
RELEASE, HAS_PARTS = 1, 2  # bits of feature_incompat
RAW, ZSTD, LZ4 = 0, 1, 2
PACKED = 1  # the filter of packed columns


class Broken(Exception):
    """A rule of the format that the file breaks: where, which, how; of a part, in which file."""

    def __init__(self, offset, clause, text):
        super().__init__(f"offset {offset}: {text} ({clause})")
        self.offset, self.clause, self.text, self.file = offset, clause, text, None


def require(holds, offset, clause, text):
    if not holds:
        raise Broken(offset, clause, text)


def round_up(n, unit):
    return (n + unit - 1) // unit * unit


# File header (container.md#file-header) ----------------------------------------------------------

FILE_MAGIC = bytes.fromhex("89505443 0d0a1a0a")
HEADER_SEED = int.from_bytes(b"PTCXHEAD", "little")
HEADER = struct.Struct("<8sHHIQQQ16sBBHI3ddB23sQ")

Header = namedtuple("Header", "identity major minor incompat uuid page_shift origin edge point_bytes")


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
     byte_order, x, y, z, edge, point_bytes, reserved, found) = HEADER.unpack_from(block)
    require(found == xxh3_64(block[:120], HEADER_SEED), 120, "spec/container.md#header-checksum",
            "file header's checksum is wrong")
    require(major == 1, 8, "spec/container.md#header-version", f"version {major} is not supported")
    require(incompat & RELEASE, 16, "spec/container.md#header-draft", "file is a draft of before version 1.0")
    require(not incompat & ~(RELEASE | HAS_PARTS), 16, "spec/container.md#header-features",
            "file needs a feature that this program does not know")
    require((header_bytes, align_shift, checksum, byte_order) == (BLOCK, 9, 1, 0x01020304), 12,
            "spec/container.md#header-constants", "a constant has another value")
    require(12 <= page_shift <= 20, 56, "spec/container.md#header-page-shift",
            "page_shift is not 12 to 20")
    require(point_bytes in (34, 40), 96, "spec/container.md#header-point-bytes",
            "point_bytes is neither 34 nor 40")
    check_frame_of((x, y, z), edge)
    require(not any(reserved) and not any(block[128:]), 97, "spec/container.md#header-zero",
            "a reserved byte is not zero")
    return Header(block[8:120], major, minor, incompat, uuid, page_shift, (x, y, z), edge,
                  point_bytes)


# Page header (container.md#page-header) ----------------------------------------------------------

PAGE = struct.Struct("<4sBBBBIIIIB7sQQQQ")

Page = namedtuple("Page", "type group codec filter rank stored_bytes raw_bytes record_count level "
                          "first_key last_key payload_xxh3")


def page_seed(uuid, type_, group, rank):
    return xxh3_64(uuid + struct.pack("<IBB", rank, type_, group))


def check_facts(header, at, type_, group, stored, raw, count, level, first):
    """The rules that page headers and directory entries share."""
    fields = "spec/container.md#page-fields"
    require(NODE <= type_ <= PARTS or type_ >= SKIPPABLE, at, "spec/container.md#page-type",
            "unknown page type")
    require(1 <= raw <= page_size(header) - PAGE_HEADER_BYTES and 1 <= stored <= raw, at,
            "spec/container.md#page-length", "stored_bytes or raw_bytes is out of range")
    suits = {NODE: count <= 0xFFFF, POINT: raw == header.point_bytes * count,
             DIRECTORY: raw == ENTRY_BYTES * count, META: count == 1, PARTS: raw == PART_BYTES * count}
    require(suits.get(type_, True), at, fields, "record_count does not suit the page")
    check_kind(at, type_, group, count, level, first)


def check_kind(at, type_, group, count, level, first):
    """The rules of an entry that a void page keeps, too."""
    fields = "spec/container.md#page-fields"
    require((type_ == ATTRIBUTE) == (group > 0), at, fields, "group does not suit the page's type")
    require(count >= 1, at, fields, "no records")
    require(level <= 62 if type_ == NODE else level == NO_LEVEL, at, fields,
            "level does not suit the page's type")
    require(first < key_limit(type_), at, "spec/container.md#page-keys", "first_key is out of range")


def key_limit(type_):
    return 1 << 63 if type_ in (NODE, POINT, PARTS) else 1


def decode_page_header(header, bytes_, at):
    magic, *fields, found = PAGE.unpack(bytes_)
    require(magic == b"PTCp", at, "spec/container.md#page-magic", "no page starts here")
    (type_, group, codec, filter_, rank, stored, raw, count, level, reserved, first, last,
     hash_) = fields
    require(found == xxh3_64(bytes_[:56], page_seed(header.uuid, type_, group, rank)), at + 56,
            "spec/container.md#page-checksum", "page header's checksum is wrong")
    check_facts(header, at, type_, group, stored, raw, count, level, first)
    require(codec <= (RAW if type_ == DIRECTORY else LZ4), at + 6,
            "spec/container.md#page-codec", "unknown codec, or a compressed directory page")
    require(filter_ <= (PACKED if type_ in (POINT, ATTRIBUTE) and codec != RAW else 0), at + 7,
            "spec/container.md#page-filter", "unknown filter, or one that suits no such page")
    require((codec == RAW) == (stored == raw), at + 12, "spec/container.md#page-length",
            "stored_bytes equals raw_bytes without codec raw, or differs with codec raw")
    require(not any(reserved), at + 25, "spec/container.md#page-fields", "reserved field is not zero")
    require(first <= last < key_limit(type_), at + 32, "spec/container.md#page-keys",
            "keys are out of range")
    return Page(type_, group, codec, filter_, rank, stored, raw, count, level, first, last, hash_)


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

ENTRY = struct.Struct("<QIIQQIBBBB")

Entry = namedtuple("Entry", "offset stored_bytes raw_bytes payload_xxh3 first_key record_count type group level")


def is_void(entry):
    return entry.type == ATTRIBUTE and not (entry.offset or entry.stored_bytes or entry.raw_bytes or entry.payload_xxh3)


def entry_of(page, offset):
    return Entry(offset, page.stored_bytes, page.raw_bytes, page.payload_xxh3, page.first_key,
                 page.record_count, page.type, page.group, page.level)


def entries_per_page(header):
    return (page_size(header) - PAGE_HEADER_BYTES) // ENTRY_BYTES


def directory_bytes(header, pages):
    full, rest = divmod(pages, entries_per_page(header))
    return full * page_size(header) + (round_up(64 + ENTRY_BYTES * rest, BLOCK) if rest else 0)


def extent_bytes(entry):
    return round_up(PAGE_HEADER_BYTES + entry.stored_bytes, SECTOR)


def decode_entry(header, bytes_, file_bytes, at):
    *fields, reserved = ENTRY.unpack(bytes_)
    entry = Entry(*fields)
    require(entry.type != DIRECTORY, at + 36, "spec/container.md#directory-listing",
            "directory lists itself")
    require(reserved == 0, at + 39, "spec/container.md#page-fields", "reserved field is not zero")
    if is_void(entry):
        check_kind(at, entry.type, entry.group, entry.record_count, entry.level, entry.first_key)
        return entry
    check_facts(header, at, entry.type, entry.group, entry.stored_bytes, entry.raw_bytes,
                entry.record_count, entry.level, entry.first_key)
    require(entry.offset % SECTOR == 0 and entry.offset >= BLOCK
            and entry.offset + extent_bytes(entry) <= file_bytes - 2 * BLOCK, at,
            "spec/container.md#directory-extent", "page lies outside the file's pages")
    return entry


# Superblock (container.md#superblock) ------------------------------------------------------------

SUPER_MAGIC = b"PTCXSUPR"
SUPER_SEED = int.from_bytes(SUPER_MAGIC, "little")
TAIL_PAGES = 64
SUPER = struct.Struct("<8s112sQIIQQIIIHHHHIQQQQH22s3d3dd3d2Q64s120s2560s1016sQ")

Superblock = namedtuple(
    "Superblock", "magic identity file_bytes page_count directory_pages directory_offset "
    "directory_xxh3 point_pages node_pages root_page root_slot levels attribute_groups reserved "
    "leaf_points points nodes node_groups tail_offset tail_pages middle bounds_low bounds_high area "
    "flux content_xxh3 writer after_writer tail rest xxh3")


def unpack_superblock(block):
    f = SUPER.unpack(block)
    return Superblock(*f[:21], f[21:24], f[24:27], f[27], f[28:31], f[31:33], *f[33:])


def nodes_from(s):
    """The number of the first node page."""
    return (1 + s.attribute_groups) * s.point_pages


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
    require(least <= s.leaf_points <= 0xFFFF, at + 172, counts, "leaf_points is out of range")
    require(s.attribute_groups <= 255, at + 168, counts, "attribute_groups is above 255")
    require((s.root_page, s.root_slot) == (NO_PAGE, 0) if empty else s.root_page < s.node_pages,
            at + 160, root, "root_page is no node page, or not absent in an empty file")
    require(least <= s.levels <= (0 if empty else 63), at + 166, root, "levels is out of range")


def read_tail(header, s, at):
    """The entries of the last pages, which lie one after another behind the directory."""
    clause = "spec/container.md#tail-pages"
    require(1 <= s.tail_pages <= min(TAIL_PAGES, s.page_count), at + 208, clause,
            "tail_pages is not 1 to 64, or above page_count")
    entries, place = [], s.tail_offset
    for i in range(s.tail_pages):
        part = s.tail[ENTRY_BYTES * i:ENTRY_BYTES * (i + 1)]
        entries.append(decode_entry(header, part, s.file_bytes, at + 512 + ENTRY_BYTES * i))
        require(entries[i].type not in (POINT, ATTRIBUTE) and entries[i].offset == place,
                at + 512 + ENTRY_BYTES * i, clause, "an entry is not of the tail's next page")
        place += extent_bytes(entries[i])
    require(round_up(place, BLOCK) == s.file_bytes - 2 * BLOCK, at + 208, clause,
            "the tail does not end at the superblocks")
    require(not any(s.tail[ENTRY_BYTES * s.tail_pages:]), at + 512, clause,
            "bytes behind the entries are not zero")
    return entries


def is_whole_superblock(block):
    return (len(block) == BLOCK and block[:8] == SUPER_MAGIC
            and unpack_superblock(block).xxh3 == xxh3_64(block[:4088], SUPER_SEED))


def decode_superblock(header, block, file_bytes, at):
    require(len(block) == BLOCK and block[:8] == SUPER_MAGIC, at,
            "spec/container.md#superblock-magic", "no superblock: unfinished or truncated")
    s = unpack_superblock(block)
    require(is_whole_superblock(block), at + 4088,
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
    require(nodes_from(s) + s.node_pages + 1 <= s.page_count, at + 128, pages,
            "page_count is less than point, attribute, node and meta pages")
    require(s.directory_offset % BLOCK == 0 and s.directory_offset >= BLOCK
            and s.directory_offset + directory_bytes(header, s.page_count) == s.tail_offset
            and s.tail_offset <= file_bytes - 2 * BLOCK, at + 136, pages,
            "directory does not lie between its offset and the tail")
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
    read_tail(header, s, at)
    require(s.reserved == 0 and not any(s.middle) and not any(s.after_writer) and not any(s.rest), at + 170, "spec/container.md#superblock-zero",
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

CHANNEL_BYTES = {1: 1, 2: 2, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
NAME_BYTES = frozenset(b"abcdefghijklmnopqrstuvwxyz0123456789_.")

Channel = namedtuple("Channel", "name type components group role colour_space no_value size unit scale offset")
Meta = namedtuple("Meta", "channels text")


def points_per_page(header):
    return (page_size(header) - PAGE_HEADER_BYTES) // header.point_bytes // 8 * 8


class Points:
    """The columns of a point page, every value checked."""

    def __init__(self, payload, count, at, point_bytes):
        require(count >= 1 and len(payload) == point_bytes * count, at,
                "spec/points.md#point-size", f"payload does not have {point_bytes} bytes a point")
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
        light = (24, 26, 28) + ((34, 36, 38) if point_bytes == 40 else ())
        require(max(max(column("H", before)) for before in light) < 0x7C00, at + 24 * count,
                "spec/points.md#point-radiance", "radiance or emission is negative or not finite")
        require(not any(payload[33 * count:34 * count]), at + 33 * count,
                "spec/points.md#point-flags", "flags are not zero")
        self.radius = column("f", 16)
        self.normal = list(zip(column("h", 20), column("h", 22)))
        self.radiance = tuple(column("e", before) for before in (24, 26, 28))
        self.albedo = tuple(column("B", before) for before in (30, 31, 32))
        dark = ((0.0,) * count,) * 3
        self.emission = tuple(column("e", before) for before in light[3:]) or dark


Column = namedtuple("Column", "before bits minus")
COLUMN_FORM = {8: "B", 16: "H", 32: "I", 42: "I", 64: "Q"}  # by bits, as payloads hold them
POINT_COLUMNS = [Column(0, 42, None), Column(4, 42, None), Column(8, 42, None),
                 Column(16, 32, None), Column(20, 16, None), Column(22, 16, None),
                 Column(26, 16, None), Column(24, 16, 6), Column(28, 16, 6),
                 Column(31, 8, None), Column(30, 8, 9), Column(32, 8, 9), Column(33, 8, None)]
EMISSION_COLUMNS = [Column(36, 16, None), Column(34, 16, 13), Column(38, 16, 13)]


def point_columns(header):
    return POINT_COLUMNS + (EMISSION_COLUMNS if header.point_bytes == 40 else [])


def group_columns(channels, group):
    out, before = [], 0
    for c in channels:
        for _ in range(c.components if c.group == group else 0):
            out.append(Column(before, 8 * c.size, None))
            before += c.size
    return out


def void_payload(channels, entry):
    """The values of a page that is not in the file (points.md#void-pages)."""
    return b"".join(((c.no_value or 0).to_bytes(c.size, "little")) * (c.components * entry.record_count)
                    for c in channels if c.group == entry.group)


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
        low = (1 << min(column.bits, 64)) - 1 if column.bits != 42 else 0xFFFFFFFF
        parts[column.before] = struct.pack(f"<{count}{form}", *(v & low for v in numbers))
    if columns[0].bits == 42:
        parts[12] = struct.pack(f"<{count}I", *(x >> 32 | y >> 32 << 10 | z >> 32 << 20
                                                for x, y, z in zip(*values[:3])))
    return b"".join(parts[before] for before in sorted(parts))


def is_name(bytes_):
    return 1 <= len(bytes_) <= 31 and NAME_BYTES.issuperset(bytes_)


def group_bytes(channels, group):
    return sum(c.size * c.components for c in channels if c.group == group)


CHANNEL = struct.Struct("<32sBBBBBBBB16sQddQ")


def decode_channel(payload, at, base, earlier, point_bytes):
    (name, type_, components, group, role, colour_space, flags, size, reserved, unit, no_value, scale,
     offset, zero) = CHANNEL.unpack_from(payload, at)
    name, _, rest = name.partition(b"\0")
    unit, _, after = unit.partition(b"\0")
    require(not any(rest) and not any(after) and reserved == zero == 0 and flags <= 1
            and (flags or not no_value), base + at, "spec/points.md#meta-zero",
            "a channel's reserved byte or bit is not zero")
    clause = "spec/points.md#meta-channel"
    require(is_name(name) and all(c.name != name.decode() for c in earlier), base + at, clause,
            "channel's name is no name or not unique")
    require(size in (1, 2, 4, 8) and CHANNEL_BYTES.get(type_, size) == size and 1 <= components <= 16
            and 1 <= group and (not earlier or earlier[-1].group <= group), base + at + 32, clause,
            "channel's type, size, components or group is out of range")
    require(no_value < 1 << 8 * size and len(unit) < 16 and is_text(unit) and scale != 0
            and math.isfinite(scale) and math.isfinite(offset), base + at + 40, clause,
            "channel's unit, no_value, scale or offset is out of range")
    require(components == 3 if role in (2, 3) else role != 5 or (type_ in (5, 6) and components == 1),
            base + at + 35, clause, "channel's type or components do not suit its role")
    channel = Channel(name.decode(), type_, components, group, role, colour_space,
                      no_value if flags else None, size, unit.decode(), scale, offset)
    require(group_bytes([*earlier, channel], group) <= point_bytes, base + at, clause,
            "channels of one group take more bytes than a point")
    return channel


DECIMAL = re.compile(r"-?[0-9]+(\.[0-9]+)?(e[+-]?[0-9]+)?", re.ASCII)


def has_form(key, value):
    """Texts whose form is fixed (points.md#texts)."""
    if key == "up":
        return value in ("x", "y", "z")
    if key == "time":
        return DECIMAL.fullmatch(value) is not None
    if key == "metres_per_unit":
        return (DECIMAL.fullmatch(value) is not None and value[0] != "-"
                and any(digit in "123456789" for digit in value.partition("e")[0]))
    return True


def decode_meta(payload, base, point_bytes):
    size = "spec/points.md#meta-size"
    require(len(payload) >= 8, base, size, "meta page is truncated")
    channel_count, text_count = struct.unpack_from("<II", payload)
    require(channel_count <= (len(payload) - 8) // CHANNEL.size, base, size, "channels are truncated")
    channels, text, at = [], {}, 8 + CHANNEL.size * channel_count
    for i in range(channel_count):
        channels.append(decode_channel(payload, 8 + CHANNEL.size * i, base, channels, point_bytes))
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
        require(has_form(key.decode(), value.decode()), base + at, "spec/points.md#meta-fact",
                "a text whose form is fixed has another one")
        text[key.decode()], last, at = value.decode(), key, at + 8 + key_bytes + value_bytes
    require(at == len(payload), base + at, size, "bytes follow the last text")
    return Meta(channels, text)


# Nodes (nodes.md) --------------------------------------------------------------------------------

Child = namedtuple("Child", "interior page slot first count")
Group = namedtuple("Group", "cell level children emits at")
COLUMNS = ("mean_x", "mean_y", "mean_z", "radius", "cone_axis", "cone_cos", "area", "thickness",
           "greatest")


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


def decode_group(payload, at, base, pages, points, may_emit):
    """The group at `at` and the number of bytes it takes."""
    here = base + at
    require(len(payload) - at >= 24, here, "spec/nodes.md#node-slots", "group is truncated")
    high, low, level, n, mask, flags, zeros = struct.unpack_from("<QQBBBBI", payload, at)
    require(1 <= n <= 8, here + 17, "spec/nodes.md#node-children", "group does not have 1 to 8 children")
    require(flags <= may_emit, here + 19, "spec/nodes.md#node-mask", "unknown or forbidden flag")
    end = at + 24 + (86 if flags else 62) * n
    size = round_up(end - at, 8)
    require(size <= len(payload) - at, here, "spec/nodes.md#node-slots", "group is truncated")
    require(level <= 62, here + 16, "spec/nodes.md#node-level", "level is above 62")
    cell = high << 63 | low
    require(max(high, low) < 1 << 63 and cell_of(cell, level) == cell, here,
            "spec/nodes.md#node-cell", "cell has digits after its level's")
    require(mask >> n == 0, here + 18, "spec/nodes.md#node-mask", "interior names no child")
    column = at + 24 + 8 * n
    require(zeros == 0 and not any(payload[end:at + size]), here + 20,
            "spec/nodes.md#node-zero", "a reserved field is not zero")
    words = struct.unpack_from(f"<{n}Q", payload, at + 24)
    children = [decode_ref(word, mask >> i & 1, pages, points, here + 24 + 8 * i)
                for i, word in enumerate(words)]
    for name, before in (("radius", 6 * n), ("area", 12 * n), ("thickness", 14 * n),
                         ("greatest", 16 * n)):
        require(max(struct.unpack_from(f"<{n}H", payload, column + before)) < 0xFF00,
                base + column + before, "spec/nodes.md#node-number", f"{name} is not finite")
    return Group(cell, level, children, bool(flags), at), size


def decode_groups(payload, count, base, pages, points, may_emit):
    slots = "spec/nodes.md#node-slots"
    at = round_up(2 * count, 8)
    require(count >= 1 and at <= len(payload), base, slots, "slot table is truncated")
    require(not any(payload[2 * count:at]), base + 2 * count, "spec/nodes.md#node-zero",
            "padding is not zero")
    groups = []
    for slot in range(count):
        require(8 * int.from_bytes(payload[2 * slot:2 * slot + 2], "little") == at,
                base + 2 * slot, slots, "group does not start where the group before it ends")
        group, size = decode_group(payload, at, base, pages, points, may_emit)
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
    out["facing"] = struct.unpack_from(f"<{6 * n}H", payload, at + 18 * n)[i::n]
    out["radiance"] = struct.unpack_from(f"<{6 * n}I", payload, at + 30 * n)[i::n]
    if group.emits:
        out["emission"] = struct.unpack_from(f"<{6 * n}I", payload, at + 54 * n)[i::n]
    return out


# Parts (parts.md) --------------------------------------------------------------------------------

PART_BYTES = 384
PART = struct.Struct("<16sQQQQIIQQQQ40s256s")
PARTS_PAGE, PARTS_COUNT, PARTS_FILE, PARTS_TOP = (
    f"spec/parts.md#parts-{rule}" for rule in ("page", "count", "file", "top"))
MOST_NODE_PAGES = (1 << 32) - 2

Part = namedtuple("Part", "uuid superblock_xxh3 file_bytes first_point points first_node_page node_pages "
                          "first_key last_key name at")


def is_path(bytes_):
    """Whether a name is a path below the folder of the scene."""
    return (1 <= len(bytes_) <= 255 and is_text(bytes_)
            and not {b"", b".", b".."}.intersection(bytes_.split(b"/")))


def decode_part(payload, at, base):
    (uuid, hash_, file_bytes, first_point, points, first_page, pages, first_high, first_low, last_high,
     last_low, reserved, name) = PART.unpack_from(payload, at)
    require(not any(reserved), base + at + 88, "spec/parts.md#parts-zero", "a reserved byte is not zero")
    name, _, rest = name.partition(b"\0")
    require(is_path(name) and not any(rest), base + at + 128, "spec/parts.md#parts-name",
            "name is no path below the scene's folder, or no zeros follow it")
    require(max(first_high, first_low, last_high, last_low) < 1 << 63, base + at + 56,
            "spec/parts.md#parts-order", "half of a key is 2^63 or more")
    return Part(uuid, hash_, file_bytes, first_point, points, first_page, pages, first_high << 63 | first_low,
                last_high << 63 | last_low, name.decode(), base + at)


def check_parts(parts, own_node_pages):
    """The rules of the records among each other; the numbers of points and node pages."""
    points, pages, last, names = 0, own_node_pages, -1, set()
    for part in parts:
        require(1 <= part.points <= (1 << 48) - points and part.first_point == points, part.at + 32,
                PARTS_COUNT, "part is empty, or does not begin where the points before it end")
        require(part.first_node_page == pages and part.node_pages <= MOST_NODE_PAGES - pages,
                part.at + 48, PARTS_COUNT, "node pages are too many, or do not begin where those before end")
        require(last < part.first_key <= part.last_key, part.at + 56, "spec/parts.md#parts-order",
                "part is not behind the part before it on the curve, or its keys descend")
        require(part.name not in names, part.at + 128, "spec/parts.md#parts-name",
                "another part has the same name")
        names.add(part.name)
        points, pages, last = points + part.points, pages + part.node_pages, part.last_key
    return points, pages


# Opening (container.md#opening) ------------------------------------------------------------------

class Container:
    """A file whose header, superblock, directory and meta page are right, and its parts if it has any.

    A file that is opened as a part is refused when it is a scene of parts."""

    def __init__(self, path, as_part=False):
        self.path, self.as_part, self.parts, self.records = path, as_part, [], []
        self.file = open(path, "rb")
        try:
            self.open()
        except (Broken, OSError):
            self.close()
            raise

    def open(self):
        self.file_bytes = os.fstat(self.file.fileno()).st_size
        self.has_zstd = shutil.which("zstd") is not None
        self.header = decode_header(self.read(0, min(BLOCK, self.file_bytes)))
        self.has_parts = bool(self.header.incompat & HAS_PARTS)
        require(not (self.has_parts and self.as_part), 16, PARTS_FILE, "a part is a scene of parts itself")
        self.superblock = self.choose_superblock()
        self.entries = self.read_directory()
        self.check_structure()
        self.meta_page = self.superblock.page_count - 1
        self.meta = Meta([], {})
        loaded = self.load([self.meta_page])
        self.knows_meta = self.meta_page in loaded
        if self.knows_meta:
            self.meta = decode_meta(loaded[self.meta_page], self.payload_at(self.meta_page),
                                    self.header.point_bytes)
            self.check_attribute_pages()
        self.all_node_pages = self.superblock.node_pages  # and those of its parts
        if self.has_parts:
            self.open_parts()

    def close(self):
        for part in self.parts:
            part.close()
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
        """A whole copy that breaks a rule is refused, whatever the other holds."""
        copies = list(self.superblock_copies())
        (block_a, a), (block_b, b) = copies
        whole = [(block, s) for block, s in copies if is_whole_superblock(block)]
        if not whole:
            self.look_for_superblock()
            raise b if block_b[:8] == SUPER_MAGIC and block_a[:8] != SUPER_MAGIC else a
        require(len(whole) == 1 or block_a == block_b, self.file_bytes - 2 * BLOCK,
                "spec/container.md#superblock-copies", "the two superblocks differ")
        _, chosen = whole[0]
        if isinstance(chosen, Broken):
            if chosen.clause == "spec/container.md#superblock-length":
                self.look_for_superblock()
            raise chosen
        return chosen

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
            require((page.type, page.rank, page.record_count) == (DIRECTORY, k, count), at, clause,
                    "not the directory page that belongs here")
            parts.append(self.read(at + PAGE_HEADER_BYTES, page.raw_bytes))
            require(xxh3_64(parts[-1]) == page.payload_xxh3, at + PAGE_HEADER_BYTES, clause,
                    "payload's checksum is wrong")
        whole = b"".join(parts)
        require(xxh3_64(whole) == s.directory_xxh3, s.directory_offset, clause,
                "entries' checksum is not the superblock's")
        return [decode_entry(self.header, whole[i * ENTRY_BYTES:(i + 1) * ENTRY_BYTES],
                             self.file_bytes, self.entry_at(i)) for i in range(s.page_count)]

    def kind_of(self, page):
        """Type and group (None: any) that a page of this number has, and its rank; of pages behind the node pages
        only the meta page has them."""
        s = self.superblock
        if page < s.point_pages:
            return POINT, 0, page
        if page < nodes_from(s):
            return ATTRIBUTE, None, page % s.point_pages
        if page < nodes_from(s) + s.node_pages:
            return NODE, 0, page - nodes_from(s)
        return (META, 0, 0) if page == s.page_count - 1 else (None, 0, None)

    def check_listing(self):
        """Every page has the type and group of its place."""
        s, clause = self.superblock, "spec/container.md#directory-listing"
        self.ranks = []
        for page, entry in enumerate(self.entries):
            type_, group, rank = self.kind_of(page)
            before = self.entries[page - 1] if page else None
            if type_ is None:
                first = page == nodes_from(s) + s.node_pages
                parts = entry.type == PARTS and self.header.incompat & HAS_PARTS
                require((parts or entry.type >= SKIPPABLE) and (first or before.type <= entry.type),
                        self.entry_at(page), clause, f"page {page} has no place behind the node pages")
                rank = 0 if first or before.type != entry.type else self.ranks[-1] + 1
            elif type_ == ATTRIBUTE:
                begins = rank == 0
                right = entry.group == before.group if not begins else \
                    page == s.point_pages or entry.group > before.group
                require(entry.type == type_ and right, self.entry_at(page), clause,
                        f"page {page} is of another type or group than its place")
            elif type_ != META:  # meta-page looks at that one
                require(entry.type == type_, self.entry_at(page), clause,
                        f"page {page} is of another type than its place")
            self.ranks.append(rank)

    def check_structure(self):
        s, end = self.superblock, BLOCK
        tail = self.file_bytes - 2 * BLOCK
        self.check_listing()
        body = s.page_count - s.tail_pages
        for page in sorted(range(body), key=lambda i: self.entries[i].offset):
            entry = self.entries[page]
            if is_void(entry):
                continue
            end, start = entry.offset + extent_bytes(entry), end
            require(start <= entry.offset and end <= s.directory_offset, self.entry_at(page),
                    "spec/container.md#directory-overlap", f"page {page} overlaps another")
        for page, entry in enumerate(self.entries):
            require((entry.type == META) == (page == s.page_count - 1), self.entry_at(page),
                    "spec/container.md#meta-page", "the last page is not the one page of type meta")
        require(read_tail(self.header, s, tail) == self.entries[body:], tail,
                "spec/container.md#tail-pages", "the tail is not the end of the directory")
        counts = "spec/container.md#superblock-counts"
        self.point_pages = range(s.point_pages)
        self.node_pages = range(nodes_from(s), nodes_from(s) + s.node_pages)
        self.own_groups = sum(self.entries[i].record_count for i in self.node_pages)
        if not self.has_parts:
            require(s.points == sum(self.entries[i].record_count for i in self.point_pages), tail,
                    counts, "directory has another number of points")
            require(s.node_groups == self.own_groups, tail, counts,
                    "directory has another number of groups")
        require(s.nodes <= 8 * s.node_groups, tail, counts, "more than 8 nodes a group")
        if s.points:
            require(s.root_slot < self.entries[self.node_pages[s.root_page]].record_count, tail,
                    "spec/container.md#superblock-root", "root group is in no node page")
        records = b"".join(struct.pack("<BBHIQ", e.type, e.group, 0, e.record_count, e.payload_xxh3)
                           for e in self.entries)
        require(xxh3_128(records) == s.content_xxh3, tail, "spec/container.md#superblock-digest",
                "content digest is not that of the directory")
        full, clause = points_per_page(self.header), "spec/points.md#point-pages"
        for page in self.point_pages:
            count, last = self.entries[page].record_count, page == s.point_pages - 1
            require(count == full or last and count < full, self.entry_at(page), clause,
                    f"page {page} is not full, or too full")

    def check_attribute_pages(self):
        clause, s = "spec/points.md#attribute-pages", self.superblock
        groups = sorted({c.group for c in self.meta.channels})
        require(len(groups) == s.attribute_groups, self.file_bytes - 2 * BLOCK, clause,
                "superblock and meta page have different numbers of channel groups")
        for j, group in enumerate(groups):
            for beside in self.point_pages:
                page = (1 + j) * s.point_pages + beside
                entry, count = self.entries[page], self.entries[beside].record_count
                require(entry.group == group and entry.record_count == count and
                        entry.raw_bytes in (0, count * group_bytes(self.meta.channels, group)),
                        self.entry_at(page), clause, f"page {page} does not suit its points")

    def read_parts(self):
        """The records of all parts pages."""
        first, tail = nodes_from(self.superblock) + self.superblock.node_pages, self.file_bytes - 2 * BLOCK
        pages = [i for i in range(first, self.meta_page) if self.entries[i].type == PARTS]
        require(pages and not self.point_pages, tail, PARTS_PAGE,
                "a scene of parts has no parts page, or has points of its own")
        full = (page_size(self.header) - PAGE_HEADER_BYTES) // PART_BYTES
        for page in pages[:-1]:
            require(self.entries[page].record_count == full, self.entry_at(page), PARTS_PAGE,
                    f"page {page} is not full")
        payloads = self.load(pages)
        if len(payloads) < len(pages):
            raise OSError(f"{self.path}: no zstd program found, which the parts pages need")
        return [decode_part(payloads[page], at, self.payload_at(page)) for page in pages
                for at in range(0, len(payloads[page]), PART_BYTES)]

    def open_parts(self):
        s, tail = self.superblock, self.file_bytes - 2 * BLOCK
        self.records = self.read_parts()
        points, self.all_node_pages = check_parts(self.records, s.node_pages)
        require(s.points == points, tail, PARTS_COUNT, f"parts have {points} points, superblock {s.points}")
        for record in self.records:
            self.parts.append(self.open_part(record))
        groups = self.own_groups + sum(part.superblock.node_groups for part in self.parts)
        require(s.node_groups == groups, tail, "spec/container.md#superblock-counts",
                f"scene and parts have {groups} groups")

    def open_part(self, record):
        path = os.path.join(os.path.dirname(self.path), *record.name.split("/"))
        try:
            part = Container(path, as_part=True)
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError) as error:
            raise in_file(path, Broken(0, PARTS_FILE, "there is no such part")) from error
        except Broken as error:
            raise in_file(path, error)
        wrong = self.difference(part, record)
        if wrong:
            part.close()
            raise in_file(path, Broken(0, PARTS_FILE, f"part is not the one that the scene names: {wrong}"))
        return part

    def difference(self, part, record):
        """What a part has other than its record or its scene."""
        s, h = part.superblock, part.header
        same = {"uuid": h.uuid == record.uuid, "length": s.file_bytes == record.file_bytes,
                "superblock": s.xxh3 == record.superblock_xxh3, "number of points": s.points == record.points,
                "number of node pages": s.node_pages == record.node_pages,
                "frame": (h.origin, h.edge) == (self.header.origin, self.header.edge),
                "page size": h.page_shift == self.header.page_shift,
                "point_bytes": h.point_bytes == self.header.point_bytes,
                "leaf_points": s.leaf_points == self.superblock.leaf_points,
                "schema": part.meta.channels == self.meta.channels or not (part.knows_meta and self.knows_meta)}
        if s.points:
            first, last = part.page_header(part.point_pages[0]), part.page_header(part.point_pages[-1])
            same["first key"] = first.first_key == record.first_key >> 63
            same["last key"] = last.last_key == record.last_key >> 63
        return ", ".join(f"another {name}" for name, holds in same.items() if not holds)

    def part_of_point(self, point):
        return bisect.bisect_right(self.records, point, key=lambda part: part.first_point) - 1

    def part_of_node_page(self, rank):
        """The part that has the node page of a rank of the scene; -1 for the scene's own pages."""
        return bisect.bisect_right(self.records, rank, key=lambda part: part.first_node_page) - 1

    def groups_on(self, rank):
        """How many groups the node page of a rank has, which may be a part's."""
        part = self.part_of_node_page(rank)
        if part < 0:
            return self.entries[self.node_pages[rank]].record_count
        return self.parts[part].groups_on(rank - self.records[part].first_node_page)

    def check_targets(self, groups, at):
        """What groups of this file refer to is there, as far as the directories show."""
        for group in groups:
            for child in group.children:
                if child.interior:
                    own = child.page < self.superblock.node_pages
                    require(child.slot < self.groups_on(child.page), at + group.at,
                            "spec/nodes.md#references" if own else PARTS_TOP, "a child is no group")
                elif self.parts:
                    last = child.first + child.count - 1
                    require(self.part_of_point(child.first) == self.part_of_point(last), at + group.at,
                            PARTS_TOP, "a leaf has points of two parts")

    def page_header(self, page, image=None):
        """The header of a page, compared with the directory. image: of the page, where it was read before."""
        at = self.entries[page].offset
        image = image or self.read(at, PAGE_HEADER_BYTES)
        header = decode_page_header(self.header, image[:PAGE_HEADER_BYTES], at)
        require(header.rank == self.ranks[page] and self.entries[page] == entry_of(header, at), at,
                "spec/container.md#page-agreement",
                f"page header is not what the directory says of page {page}")
        return header

    def load(self, pages):
        """Payloads of pages, verified and decoded; without zstd only of those that are raw."""
        out, jobs = {}, []
        self.headers = {}
        for i in pages:
            entry = self.entries[i]
            if is_void(entry):
                out[i], self.headers[i] = void_payload(self.meta.channels, entry), None
                continue
            at = entry.offset
            image = self.read(at, PAGE_HEADER_BYTES + entry.stored_bytes)
            page = self.page_header(i, image)
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
            if self.headers[i] and self.headers[i].filter == PACKED:
                out[i] = self.unpack(self.headers[i], payload, self.payload_at(i))
        return out

    def unpack(self, page, packed, at):
        columns = (point_columns(self.header) if page.type == POINT
                   else group_columns(self.meta.channels, page.group))
        return unpack_columns(packed, columns, page.record_count, at)

    def payload_at(self, page):
        return self.entries[page].offset + PAGE_HEADER_BYTES

    def points(self):
        """Point pages in order: Points with columns x, y, z, keys, radius, normal, ..."""
        for part in self.parts:
            yield from part.points()
        for page in self.point_pages:
            payload = self.load([page])[page]
            yield Points(payload, self.entries[page].record_count, self.payload_at(page),
                         self.header.point_bytes)

    def groups(self, page):
        """The groups of the node page of a rank and its payload, for summary().

        References of a part's groups are ranks and numbers of the scene."""
        part = self.part_of_node_page(page)
        if part >= 0:
            record = self.records[part]
            groups, payload = self.parts[part].groups(page - record.first_node_page)
            return [in_scene(group, record) for group in groups], payload
        page = self.node_pages[page]
        return self.decode_nodes(page, payload := self.load([page])[page]), payload

    def decode_nodes(self, page, payload):
        at = self.payload_at(page)
        groups = decode_groups(payload, self.entries[page].record_count, at, self.all_node_pages,
                               self.superblock.points, self.header.point_bytes == 40)
        self.check_targets(groups, at)
        return groups


def in_file(path, error):
    """An error that names the file of a part."""
    error.file = error.file or path
    return error


def in_scene(group, record):
    """A group of a part with references by the numbers of the scene."""
    return group._replace(children=[
        c._replace(page=c.page + record.first_node_page) if c.interior
        else c._replace(first=c.first + record.first_point) for c in group.children])


def open_container(path):
    """Opens a container. Raises Broken or OSError."""
    return Container(path)


# The program -------------------------------------------------------------------------------------

def shown(path):
    """A path with its control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in path)


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
            print(json.dumps({"valid": False, "file": error.file or options.file, "offset": error.offset,
                              "clause": error.clause, "text": error.text}))
        else:
            print(f"{shown(error.file or options.file)}: {error}")
        return 1
    except OSError as error:
        print(f"{options.file}: {error}", file=sys.stderr)
        return 3
    print(json.dumps(facts)) if options.json else print_verdict(options.file, facts)
    return 0


if __name__ == "__main__":
    import reader  # one module, whoever imports it
    sys.exit(reader.main())
