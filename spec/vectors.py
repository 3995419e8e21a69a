"""Writes the vectors: reader.py's twin, which makes files instead of reading them.

Which files there are say vectors_good.py, vectors_bad.py and vectors_verify.py, each with a list of
(name, Draft or bytes). The same bytes each time, but for pages that zstd compressed.
"""

import itertools
import math
import os
import shutil
import struct
import subprocess

import reader as r
from vectors_tree import Tree, encode_group
from xxh3 import xxh3_128, xxh3_64

UUID = bytes(range(1, 17))
UNIT_EDGE = 2.0 ** 22  # edge of the frames here: the unit is 2^-20


def encode_points(surfels):
    out = b""
    for axis in range(3):
        out += b"".join(struct.pack("<I", s.q[axis] & 0xFFFFFFFF) for s in surfels)
    out += b"".join(struct.pack("<I", sum(s.q[k] >> 32 << 10 * k for k in range(3)))
                    for s in surfels)
    out += b"".join(struct.pack("<f", s.radius) for s in surfels)
    for k in range(2):
        out += b"".join(struct.pack("<h", s.uv[k]) for s in surfels)
    for k in range(3):
        out += b"".join(struct.pack("<H", s.half[k]) for s in surfels)
    for k in range(3):
        out += bytes(s.albedo[k] for s in surfels)
    return out + bytes(len(surfels))


def pack_columns(payload, columns, count, loose=()):
    """The packed form of columns (points.md#packed-columns), as long as may be of the widths `loose`."""
    out, values = b"", []
    for column in columns:
        form = r.COLUMN_FORM[column.bits]
        numbers = list(struct.unpack_from(f"<{count}{form}", payload, column.before * count))
        if column.bits == 42:
            high = struct.unpack_from(f"<{count}I", payload, 12 * count)
            numbers = [low | (top >> column.before // 4 * 10 & 1023) << 32
                       for low, top in zip(numbers, high)]
        values.append(numbers)
        mask = (1 << column.bits) - 1
        if column.minus is not None:
            numbers = [a - b & mask for a, b in zip(numbers, values[column.minus])]
        seen = 0
        for v in numbers:
            seen |= v
        long = column.bits in loose
        shift = (seen & -seen).bit_length() - 1 if seen and not long else 0
        base = mask if long else numbers[0]
        steps = [b - a & mask for a, b in zip([base] + numbers, numbers)]
        steps = [(d - mask - 1 if d >> column.bits - 1 else d) >> shift for d in steps]
        if long and column.bits % 8:
            steps = [d + mask + 1 for d in steps]  # there is room for once around
        codes = [2 * d if d >= 0 else -2 * d - 1 for d in steps]
        planes = ((column.bits if long else max(codes).bit_length()) + 7) // 8
        out += struct.pack("<BBQ", shift, planes, base)
        for k in range(planes):
            out += bytes(c >> 8 * k & 255 for c in codes)
    return out


def frame_of(content, width=1, checksum=b""):
    """A zstd frame made by hand: runs of a byte, and what lies between them as it is.

    width: bytes of the content size; checksum: of the content (RFC 8878, section 3.1.1)."""
    blocks = []  # (kind, bytes): 0 as they are, 1 repeated
    for _, run in itertools.groupby(content):
        run = bytes(run)
        if len(run) < 8 and blocks and blocks[-1][0] == 0:
            blocks[-1] = (0, blocks[-1][1] + run)
        else:
            blocks.append((1 if len(run) >= 8 else 0, run))
    size = len(content) - (256 if width == 2 else 0)
    out = struct.pack("<IB", 0xFD2FB528, (width.bit_length() - 1) << 6 | 0x20 | 4 * bool(checksum))
    out += size.to_bytes(width, "little")
    for i, (kind, run) in enumerate(blocks):
        head = len(run) << 3 | kind << 1 | (i + 1 == len(blocks))
        out += head.to_bytes(3, "little") + (run[:1] if kind else run)
    return out + checksum


def literal_block(content):
    """An LZ4 block, made by hand, of 15 or more literals."""
    more = len(content) - 15
    return (struct.pack("<I", len(content)) + b"\xf0" + b"\xff" * (more // 255)
            + bytes([more % 255]) + content)


def encode_meta(channels=(), text=()):
    out = struct.pack("<II", len(channels), len(text))
    for name, type_, components, group in channels:
        out += struct.pack("<32sBBHI", name.encode(), type_, components, group, 0)
    for key, value in text:
        out += struct.pack("<II", len(key), len(value.encode())) + key.encode() + value.encode()
    return out


# The file (container.md) -------------------------------------------------------------------------

class Page:
    """A page to be written. Fields of `header` and `entry` override what follows from the rest."""

    def __init__(self, type_, payload, count, group=0, level=0xFFFF, keys=(0, 0)):
        self.type, self.payload, self.count = type_, bytearray(payload), count
        self.group, self.level, self.keys = group, level, keys
        self.stored, self.codec, self.filter = None, r.RAW, 0
        self.uuid = None
        self.header, self.entry = {}, {}

    def fields(self, page_id):
        stored = self.payload if self.stored is None else self.stored
        out = {"type": self.type, "codec": self.codec, "filter": self.filter,
               "page_id": page_id,
               "stored_bytes": len(stored), "raw_bytes": len(self.payload), "group": self.group,
               "level": self.level, "record_count": self.count, "reserved": 0,
               "first_key": self.keys[0], "last_key": self.keys[1],
               "payload_xxh3": xxh3_64(bytes(stored))}
        return out, bytes(stored)


class Draft:
    """A file to be written; tests of a rule change it before or after it becomes bytes."""

    def __init__(self, surfels=(), leaf_points=8, page_shift=12, channels=(), text=(),
                 origin=(0.0, 0.0, 0.0), edge=UNIT_EDGE):
        self.surfels = sorted(surfels, key=lambda s: s.key)
        self.page_shift, self.leaf_points = page_shift, leaf_points
        self.origin, self.edge, self.unit = origin, edge, edge * 2 ** -42
        self.head = {"major": 1, "minor": 0, "header_bytes": 4096, "incompat": 0, "ro_compat": 0,
                     "compat": 0, "uuid": UUID, "page_shift": page_shift, "align_shift": 9,
                     "checksum": 1, "byte_order": 0x01020304, "origin": origin, "edge": edge, "reserved": bytes(24)}
        self.pages, self.super, self.super_b, self.directory = [], {}, {}, {}
        self.lie = sorted  # page numbers to the order in which the pages lie in the file
        self.patches = []  # (offset from the start, or from the end when negative, bytes)
        self.tree = Tree(self.surfels, leaf_points, self.unit)
        self.add_points()
        self.add_nodes()
        self.add_attributes(channels)
        self.pages.append(Page(r.META, encode_meta(channels, text), 1))

    def add_points(self):
        full = ((1 << self.page_shift) - 64) // 34 // 8 * 8
        for i in range(0, len(self.surfels), full):
            part = self.surfels[i:i + full]
            self.pages.append(Page(r.POINT, encode_points(part), len(part),
                                   keys=(part[0].key >> 63, part[-1].key >> 63)))
        self.point_pages = len(self.pages)

    def add_nodes(self):
        """Groups in their order, as many to a page as fit."""
        self.places, batch, room = [], [], 0
        limit = (1 << self.page_shift) - 64
        self.batches = batches = [batch]
        for group in self.tree.groups:
            size = r.round_up(24 + 60 * len(group[2]), 8)
            if batch and r.round_up(2 * len(batch) + 2, 8) + room + size > limit:
                batch, room = [], 0
                batches.append(batch)
            self.places.append((self.point_pages + len(batches) - 1, len(batch)))
            batch.append(group)
            room += size
        for batch in batches:
            if batch:
                self.pages.append(self.node_page(batch))

    def node_page(self, groups):
        table, body = [], b""
        start = r.round_up(2 * len(groups), 8)
        for cell, level, refs, columns in groups:
            table.append((start + len(body)) // 8)
            words = [(i, self.word(i, where)) for i, where in refs]
            body += encode_group(cell, level, words, columns)
        payload = struct.pack(f"<{len(table)}H", *table)
        highs = [group[0] >> 63 for group in groups]
        return Page(r.NODE, payload + bytes(start - len(payload)) + body, len(groups),
                    level=min(group[1] for group in groups), keys=(min(highs), max(highs)))

    def renumber(self, order):
        """Page order[i] becomes page i; references follow."""
        number = {page: i for i, page in enumerate(order)}
        self.places = [(number[page], slot) for page, slot in self.places]
        nodes = map(self.node_page, self.batches)
        pages = [next(nodes) if page.type == r.NODE else page for page in self.pages]
        self.pages = [pages[i] for i in order]

    def word(self, interior, where):
        if interior:
            page, slot = self.places[where]
            return page | slot << 32
        return where[0] | where[1] << 48

    def add_attributes(self, channels):
        for group in sorted({c[3] for c in channels}):
            for page in self.pages[:self.point_pages]:
                payload = b""
                for _, type_, components, of_group in channels:
                    if of_group == group:
                        value = {1: b"\x07", 2: b"\x01\x02", 3: b"\x00\x3c", 4: bytes(4)}[type_]
                        payload += value * components * page.count
                self.pages.append(Page(r.ATTRIBUTE, payload, page.count, group, keys=page.keys))

    def pack(self, page, columns, codec, loose=()):
        packed = pack_columns(bytes(page.payload), columns, page.count, loose)
        page.stored = frame_of(packed, 2 if len(packed) > 255 else 1) if codec == r.ZSTD else literal_block(packed)
        page.codec, page.filter = codec, r.PACKED

    def compress(self, page):
        """Stores a page as zstd does it."""
        zstd = ["zstd", "-q", "-1", "--no-check", "-c", f"--stream-size={len(page.payload)}"]
        page.stored = subprocess.run(zstd, input=bytes(page.payload), check=True,
                                     stdout=subprocess.PIPE).stdout
        page.codec = r.ZSTD
        if len(page.stored) >= len(page.payload):
            page.stored, page.codec = None, r.RAW

    def identity(self):
        h = self.head
        return struct.pack("<HHIQQQ16sBBHI3dd24s", h["major"], h["minor"], h["header_bytes"],
                           h["incompat"], h["ro_compat"], h["compat"], h["uuid"], h["page_shift"],
                           h["align_shift"], h["checksum"], h["byte_order"],
                           *h["origin"], h["edge"], h["reserved"])

    def page_image(self, page, fields, stored):
        names = ("type", "codec", "filter", "page_id", "stored_bytes", "raw_bytes", "group", "level",
                 "record_count", "reserved", "first_key", "last_key", "payload_xxh3")
        body = b"PTCp" + struct.pack("<HBBIIIHHIIQQQ", *(fields[name] for name in names))
        uuid = page.uuid or self.head["uuid"]
        seed = r.page_seed(uuid, fields["page_id"], fields["type"])
        image = body + struct.pack("<Q", xxh3_64(body, seed)) + stored
        return image + bytes(-len(image) % r.SECTOR)

    def totals(self):
        s = self.surfels
        low = [min((p.q[k] for p in s), default=0) for k in range(3)]
        high = [max((p.q[k] for p in s), default=0) for k in range(3)]
        place = [tuple(o + q * self.unit for o, q in zip(self.origin, corner)) if s else (0.0,) * 3
                 for corner in (low, high)]
        return {"bounds_low": place[0], "bounds_high": place[1],
                "area": math.fsum(p.area for p in s),
                "flux": tuple(math.fsum(p.area * p.radiance[c] for p in s) for c in range(3))}

    def superblock(self, facts, overrides):
        f = {**facts, **overrides}
        body = r.SUPER_MAGIC + f["identity"] + struct.pack(
            "<QIIQQIIHHIIIQQQ32s3d3dd3d2Q64s3696s", f["file_bytes"], f["page_count"],
            f["directory_pages"], f["directory_offset"], f["directory_xxh3"], f["meta_page"],
            f["root_page"], f["root_slot"], f["levels"], f["leaf_points"], f["points_per_page"],
            f["reserved"], f["points"], f["nodes"], f["node_groups"], f["middle"],
            *f["bounds_low"], *f["bounds_high"], f["area"], *f["flux"], *f["content_xxh3"],
            f["writer"], f["rest"])
        return body + struct.pack("<Q", xxh3_64(body, r.SUPER_SEED))

    def facts(self):
        groups = self.tree.groups
        root = self.places[self.tree.root] if groups else (r.NO_PAGE, 0)
        return {"identity": self.identity(), "page_count": len(self.pages),
                "meta_page": [page.type for page in self.pages].index(r.META), "root_page": root[0], "root_slot": root[1],
                "levels": max((g[1] + 1 for g in groups), default=0),
                "leaf_points": self.leaf_points, "reserved": 0, "rest": bytes(3696),
                "points_per_page": ((1 << self.page_shift) - 64) // 34 // 8 * 8,
                "points": len(self.surfels), "nodes": sum(len(g[2]) for g in groups),
                "node_groups": len(groups), "middle": bytes(32),
                "writer": b"spec/vectors.py", **self.totals()}

    def to_bytes(self):
        head = r.FILE_MAGIC + self.identity()
        out = head + struct.pack("<Q", xxh3_64(head, r.HEADER_SEED))
        out += bytes(r.BLOCK - len(out))
        entries, records, offsets = b"", b"", {}
        for i in self.lie(range(len(self.pages))):
            offsets[i] = len(out)
            fields, stored = self.pages[i].fields(i)
            out += self.page_image(self.pages[i], {**fields, **self.pages[i].header}, stored)
        for i, page in enumerate(self.pages):
            e = {**page.fields(i)[0], "offset": offsets[i], **page.entry}
            entries += r.ENTRY.pack(e["offset"], e["stored_bytes"], e["raw_bytes"],
                                    e["payload_xxh3"], e["type"], e["group"], e["record_count"])
            records += struct.pack("<HHIQ", e["type"], e["group"], e["record_count"],
                                   e["payload_xxh3"])
        out += bytes(-len(out) % r.BLOCK)
        facts = {**self.facts(), "directory_offset": len(out), "directory_xxh3": xxh3_64(entries),
                 "content_xxh3": xxh3_128(records)}
        full = ((1 << self.page_shift) - 64) // 32 * 32
        for k in range(0, len(entries), full):
            page = Page(r.DIRECTORY, entries[k:k + full], len(entries[k:k + full]) // 32)
            fields, stored = page.fields(len(self.pages) + k // full)
            out += self.page_image(page, {**fields, **self.directory}, stored)
        out += bytes(-len(out) % r.BLOCK)
        facts["directory_pages"] = (len(entries) - 1) // full + 1
        facts["file_bytes"] = len(out) + 2 * r.BLOCK
        out += self.superblock(facts, self.super)
        out += self.superblock(facts, {**self.super, **self.super_b})
        for at, new in self.patches:
            at = at if at >= 0 else len(out) + at
            out = out[:at] + new + out[at + len(new):]
        return out

    def offset(self, page):
        """Where a page of a raw file without changed lengths starts."""
        return r.BLOCK + sum(r.round_up(64 + len(p.payload), r.SECTOR) for p in self.pages[:page])


def all_vectors():
    """(folder, name, Draft or bytes) of every vector that can be written here."""
    import vectors_bad
    import vectors_good
    import vectors_verify
    for folder, source in (("good", vectors_good), ("bad", vectors_bad), ("verify", vectors_verify)):
        for name, draft in source.vectors():
            yield folder, name, draft


def expected(name, draft, whole):
    """A line of good.txt: what every reader finds in a good file."""
    s = r.unpack_superblock(whole[-r.BLOCK:])
    payloads = xxh3_64(b"".join(bytes(page.payload) for page in draft.pages))
    return (f"{name} {s.points} {s.nodes} {s.node_groups} {s.levels} {s.page_count} "
            f"{s.content_xxh3[1]:016x}{s.content_xxh3[0]:016x} {payloads:016x}\n")


def write_all(directory):
    """Writes all vectors and good.txt; the number of an exit code."""
    made, lines = 0, []
    for kind, name, draft in all_vectors():
        folder = os.path.join(directory, kind)
        os.makedirs(folder, exist_ok=True)
        whole = draft if isinstance(draft, bytes) else draft.to_bytes()
        with open(os.path.join(folder, name + ".ptcx"), "wb") as file:
            file.write(whole)
        if kind == "good":
            lines.append(expected(name, draft, whole))
        made += 1
    with open(os.path.join(directory, "good.txt"), "w", encoding="utf-8") as file:
        file.writelines(sorted(lines))
    print(made, "vectors written")
    return 0
