"""Writes the vectors: reader.py's twin, which makes files instead of reading them.

Which files there are say vectors_good.py, vectors_bad.py, vectors_verify.py and, of scenes of parts,
vectors_parts.py, each with a list of (name, Draft or bytes). The same bytes each time, but for pages that zstd compressed.
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


def encode_points(surfels, point_bytes):
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
    out += bytes(len(surfels))
    for k in range(3 if point_bytes == 40 else 0):
        out += b"".join(struct.pack("<H", s.own[k]) for s in surfels)
    return out


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


def channel(name, type_, components, group, **fields):
    """A row of the schema: r.Channel with what is not named as usual."""
    usual = {"role": 0, "colour_space": 0, "no_value": None, "size": r.CHANNEL_BYTES.get(type_, 1),
             "unit": "", "scale": 1.0, "offset": 0.0}
    return r.Channel(name, type_, components, group, **{**usual, **fields})


def encode_channel(c):
    return r.CHANNEL.pack(c.name.encode(), c.type, c.components, c.group, c.role, c.colour_space,
                          c.no_value is not None, c.size, 0, c.unit.encode(), c.no_value or 0,
                          c.scale, c.offset, 0)


def encode_meta(channels=(), text=()):
    out = struct.pack("<II", len(channels), len(text)) + b"".join(map(encode_channel, channels))
    for key, value in text:
        out += struct.pack("<II", len(key), len(value.encode())) + key.encode() + value.encode()
    return out


# The file (container.md) -------------------------------------------------------------------------

class Page:
    """A page to be written. Fields of `header` and `entry` override what follows from the rest."""

    def __init__(self, type_, payload, count, group=0, level=r.NO_LEVEL, keys=(0, 0), void=False):
        self.type, self.payload, self.count = type_, bytearray(payload), count
        self.group, self.level, self.keys = group, level, keys
        self.stored, self.codec, self.filter = None, r.RAW, 0
        self.uuid, self.void = None, void
        self.header, self.entry = {}, {}

    def fields(self, rank):
        stored = self.payload if self.stored is None else self.stored
        out = {"type": self.type, "group": self.group, "codec": self.codec, "filter": self.filter,
               "rank": rank, "stored_bytes": len(stored), "raw_bytes": len(self.payload),
               "record_count": self.count, "level": self.level, "reserved": bytes(7),
               "first_key": self.keys[0], "last_key": self.keys[1],
               "payload_xxh3": xxh3_64(bytes(stored))}
        return out, bytes(stored)


class Draft:
    """A file to be written; tests of a rule change it before or after it becomes bytes."""

    def __init__(self, surfels=(), leaf_points=8, page_shift=12, channels=(), text=(),
                 origin=(0.0, 0.0, 0.0), edge=UNIT_EDGE, point_bytes=34, tail_nodes=63):
        self.surfels = sorted(surfels, key=lambda s: s.key)
        self.page_shift, self.leaf_points = page_shift, leaf_points
        self.origin, self.edge, self.unit = origin, edge, edge * 2 ** -42
        self.point_bytes, self.tail_nodes = point_bytes, tail_nodes
        self.channels = channels = [c if isinstance(c, r.Channel) else channel(*c) for c in channels]
        self.head = {"major": 1, "minor": 0, "header_bytes": 4096, "incompat": r.RELEASE, "ro_compat": 0,
                     "compat": 0, "uuid": UUID, "page_shift": page_shift, "align_shift": 9,
                     "checksum": 1, "byte_order": 0x01020304, "origin": origin, "edge": edge, "point_bytes": point_bytes,
                     "reserved": bytes(23)}
        self.pages, self.super, self.super_b, self.directory = [], {}, {}, {}
        self.lie = sorted  # numbers of the pages before the tail to the order in which they lie in the file
        self.patches = []  # (offset from the start, or from the end when negative, bytes)
        self.tree = Tree(self.surfels, leaf_points, self.unit)
        self.add_points()
        self.add_attributes(channels)
        self.add_nodes()
        self.pages.append(Page(r.META, encode_meta(channels, text), 1))

    def add_points(self):
        full = ((1 << self.page_shift) - 64) // self.point_bytes // 8 * 8
        for i in range(0, len(self.surfels), full):
            part = self.surfels[i:i + full]
            self.pages.append(Page(r.POINT, encode_points(part, self.point_bytes), len(part),
                                   keys=(part[0].key >> 63, part[-1].key >> 63)))
        self.point_pages = len(self.pages)

    def add_nodes(self):
        """Groups in their order, as many to a page as fit."""
        self.first_node = len(self.pages)
        self.places, batch, room = [], [], 0
        limit = (1 << self.page_shift) - 64
        self.batches = batches = [batch]
        for group in self.tree.groups:
            emits = any(c["emits"] for c in group[3])
            size = r.round_up(24 + (86 if emits else 62) * len(group[2]), 8)
            if batch and r.round_up(2 * len(batch) + 2, 8) + room + size > limit:
                batch, room = [], 0
                batches.append(batch)
            self.places.append((len(batches) - 1, len(batch)))
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
        """Node page order[i] gets rank i; references follow."""
        rank = {page: i for i, page in enumerate(order)}
        self.places = [(rank[page], slot) for page, slot in self.places]
        nodes = [self.node_page(batch) for batch in self.batches]
        self.pages[self.first_node:self.first_node + len(nodes)] = [nodes[i] for i in order]

    def word(self, interior, where):
        if interior:
            page, slot = self.places[where]
            return page | slot << 32
        return where[0] | where[1] << 48

    def add_attributes(self, channels):
        for group in sorted({c.group for c in channels}):
            for page in self.pages[:self.point_pages]:
                payload = b""
                for c in channels:
                    if c.group == group:
                        value = bytes([7, 60, 0, 0, 1, 0, 0, 0])[:c.size]
                        payload += value * c.components * page.count
                self.pages.append(Page(r.ATTRIBUTE, payload, page.count, group))

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
        return struct.pack("<HHIQQQ16sBBHI3ddB23s", h["major"], h["minor"], h["header_bytes"],
                           h["incompat"], h["ro_compat"], h["compat"], h["uuid"], h["page_shift"],
                           h["align_shift"], h["checksum"], h["byte_order"],
                           *h["origin"], h["edge"], h["point_bytes"], h["reserved"])

    def page_image(self, page, fields, stored):
        names = ("type", "group", "codec", "filter", "rank", "stored_bytes", "raw_bytes", "record_count",
                 "level", "reserved", "first_key", "last_key", "payload_xxh3")
        body = b"PTCp" + struct.pack("<BBBBIIIIB7sQQQ", *(fields[name] for name in names))
        uuid = page.uuid or self.head["uuid"]
        seed = r.page_seed(uuid, fields["type"], fields["group"], fields["rank"])
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
                "flux": tuple(math.fsum(p.area * (p.radiance[c] + p.emission[c]) for p in s)
                              for c in range(3))}

    def superblock(self, facts, overrides):
        f = {**facts, **overrides}
        body = r.SUPER_MAGIC + f["identity"] + struct.pack(
            "<QIIQQIIIHHHHIQQQQH22s3d3dd3d2Q64s120s2560s1016s", f["file_bytes"], f["page_count"],
            f["directory_pages"], f["directory_offset"], f["directory_xxh3"], f["point_pages"],
            f["node_pages"], f["root_page"], f["root_slot"], f["levels"], f["attribute_groups"],
            f["reserved"], f["leaf_points"], f["points"], f["nodes"], f["node_groups"],
            f["tail_offset"], f["tail_pages"], f["middle"], *f["bounds_low"], *f["bounds_high"],
            f["area"], *f["flux"], *f["content_xxh3"], f["writer"], f["after_writer"], f["tail"],
            f["rest"])
        return body + struct.pack("<Q", xxh3_64(body, r.SUPER_SEED))

    def facts(self):
        groups = self.tree.groups
        root = self.places[self.tree.root] if groups else (r.NO_PAGE, 0)
        return {"identity": self.identity(), "page_count": len(self.pages),
                "point_pages": sum(page.type == r.POINT for page in self.pages),
                "node_pages": sum(page.type == r.NODE for page in self.pages),
                "attribute_groups": len({c.group for c in self.channels}),
                "root_page": root[0], "root_slot": root[1],
                "levels": max((g[1] + 1 for g in groups), default=0),
                "leaf_points": self.leaf_points, "reserved": 0, "middle": bytes(22),
                "after_writer": bytes(120), "rest": bytes(1016),
                "points": len(self.surfels), "nodes": sum(len(g[2]) for g in groups),
                "node_groups": len(groups), "writer": b"spec/vectors.py", **self.totals()}

    def tail_from(self):
        """The number of the first page of the tail."""
        last = len(self.pages)
        while last > 0 and self.pages[last - 1].type not in (r.POINT, r.ATTRIBUTE) \
                and len(self.pages) - last <= self.tail_nodes:
            last -= 1
        return last

    def ranks(self):
        seen, out = {}, []
        for page in self.pages:
            out.append(seen.get((page.type, page.group), 0))
            seen[page.type, page.group] = out[-1] + 1
        return out

    def to_bytes(self):
        head = r.FILE_MAGIC + self.identity()
        out = head + struct.pack("<Q", xxh3_64(head, r.HEADER_SEED))
        out += bytes(r.BLOCK - len(out))
        tail, ranks, offsets = self.tail_from(), self.ranks(), {}
        images = {}
        for i, page in enumerate(self.pages):
            fields, stored = page.fields(ranks[i])
            images[i] = b"" if page.void else self.page_image(page, {**fields, **page.header}, stored)
        for i in self.lie(range(tail)):
            offsets[i] = len(out)
            out += images[i]
        out += bytes(-len(out) % r.BLOCK)
        full = ((1 << self.page_shift) - 64) // r.ENTRY_BYTES * r.ENTRY_BYTES
        count = len(self.pages)
        size = (count * r.ENTRY_BYTES // full << self.page_shift) + (
            r.round_up(64 + count * r.ENTRY_BYTES % full, r.BLOCK) if count * r.ENTRY_BYTES % full else 0)
        directory_offset, place = len(out), len(out) + size
        for i in range(tail, count):
            offsets[i] = place
            place += len(images[i])
        entries, records = b"", b""
        for i, page in enumerate(self.pages):
            e = {**page.fields(ranks[i])[0], "offset": offsets[i]}
            if page.void:
                e.update(offset=0, stored_bytes=0, raw_bytes=0, payload_xxh3=0)
            e.update(page.entry)
            entries += r.ENTRY.pack(e["offset"], e["stored_bytes"], e["raw_bytes"], e["payload_xxh3"],
                                    e["first_key"], e["record_count"], e["type"], e["group"],
                                    e["level"], e.get("zero", 0))
            records += struct.pack("<BBHIQ", e["type"], e["group"], 0, e["record_count"],
                                   e["payload_xxh3"])
        facts = {**self.facts(), "directory_offset": directory_offset,
                 "directory_xxh3": xxh3_64(entries), "content_xxh3": xxh3_128(records),
                 "tail_offset": directory_offset + size, "tail_pages": count - tail,
                 "tail": entries[tail * r.ENTRY_BYTES:].ljust(2560, b"\0")}
        for k in range(0, len(entries), full):
            page = Page(r.DIRECTORY, entries[k:k + full], len(entries[k:k + full]) // r.ENTRY_BYTES)
            fields, stored = page.fields(k // full)
            out += self.page_image(page, {**fields, **self.directory}, stored)
        out += bytes(-len(out) % r.BLOCK)
        for i in range(tail, count):
            out += images[i]
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
        tail = self.tail_from()
        sizes = [r.round_up(64 + len(p.payload), r.SECTOR) for p in self.pages]
        if page < tail:
            return r.BLOCK + sum(sizes[:page])
        body = r.round_up(r.BLOCK + sum(sizes[:tail]), r.BLOCK)
        entries = len(self.pages) * r.ENTRY_BYTES
        full = ((1 << self.page_shift) - 64) // r.ENTRY_BYTES * r.ENTRY_BYTES
        directory = (entries // full << self.page_shift) + r.round_up(64 + entries % full, r.BLOCK)
        return body + directory + sum(sizes[tail:page])


def all_vectors():
    """(folder, name, Draft or bytes) of every vector that can be written here."""
    import vectors_bad
    import vectors_good
    import vectors_parts
    import vectors_verify
    for folder, sources in (("good", (vectors_good.vectors, vectors_parts.good)),
                            ("bad", (vectors_bad.vectors, vectors_parts.bad)),
                            ("verify", (vectors_verify.vectors, vectors_parts.verify))):
        for source in sources:
            for name, draft in source():
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
        path = os.path.join(directory, kind, name + ".ptcx")
        os.makedirs(os.path.dirname(path), exist_ok=True)
        whole = draft if isinstance(draft, bytes) else draft.to_bytes()
        with open(path, "wb") as file:
            file.write(whole)
        if kind == "good" and "/" not in name:  # a part is listed with its scene
            lines.append(expected(name, draft, whole))
        made += 1
    with open(os.path.join(directory, "good.txt"), "w", encoding="utf-8") as file:
        file.writelines(sorted(lines))
    print(made, "vectors written")
    return 0
