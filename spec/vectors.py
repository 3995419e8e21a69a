"""Writes the vectors: reader.py's twin, which makes files instead of reading them.

good/ holds files that every reader accepts, bad/ and verify/ one file for each rule, named by the
rule's document and anchor, all checksums right but those that the rule is about. Readers refuse
bad/, only a verifier has to refuse verify/. The same bytes each time, but for pages that zstd
compressed.
"""

import math
import os
import shutil
import struct
import subprocess

import reader as r
from xxh3 import xxh3_128, xxh3_64

UUID = bytes(range(1, 17))
UNIT_EDGE = 2.0 ** 22  # edge of the frames here: the unit is 2^-20


# Types (README.md#types) -------------------------------------------------------------------------

def half(x):
    return struct.unpack("<H", struct.pack("<e", min(x, 65504.0)))[0]


def float_bits(x):
    return struct.unpack("<I", struct.pack("<f", x))[0]


def ufloat16_up(x):
    bits = float_bits(x)
    if struct.unpack("<f", struct.pack("<I", bits))[0] < x:
        bits += 1
    return min((bits + 0x7FFF) >> 15, 0xFEFF)


def ufloat16(x):
    bits = float_bits(x)
    return min((bits + 0x3FFF + (bits >> 15 & 1)) >> 15, 0xFEFF)


def rgbe(rgb):
    greatest = max(rgb)
    if greatest <= 0:
        return 0
    exponent = min(max(math.frexp(greatest)[1], -128), 127)
    parts = [min(255, math.floor(math.ldexp(c, 8 - exponent) + 0.5)) for c in rgb]
    return parts[0] | parts[1] << 8 | parts[2] << 16 | exponent + 128 << 24


def octahedral(n, q):
    length = sum(map(abs, n))
    u, v = n[0] / length, n[1] / length
    if n[2] < 0:
        u, v = math.copysign(1 - abs(v), u), math.copysign(1 - abs(u), v)
    return tuple(int(math.copysign(math.floor(abs(c) * q + 0.5), c)) for c in (u, v))


def unfold(u, v, q):
    x, y = max(u, -q) / q, max(v, -q) / q
    z = 1 - abs(x) - abs(y)
    if z < 0:
        x, y = math.copysign(1 - abs(y), x), math.copysign(1 - abs(x), y)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


# Points and their summaries (points.md, nodes.md#summary) ----------------------------------------

class Surfel:
    """A surfel at a lattice point."""

    def __init__(self, q, normal=(0, 0, 1), radius=0.0, radiance=(0, 0, 0), albedo=(0, 0, 0)):
        self.q, self.albedo = q, albedo
        self.key = r.interleave(*q)
        self.uv = octahedral(normal, 32767)
        self.normal = unfold(*self.uv, 32767)
        self.radius = struct.unpack("<f", struct.pack("<f", radius))[0]
        self.half = tuple(map(half, radiance))
        self.radiance = tuple(map(r.half_to_float, self.half))
        self.area = 2 * self.radius * self.radius


def scatter(count, seed, bits=42):
    """Surfels all over a cube, the same each time."""
    x, surfels = seed, []

    def draw():
        nonlocal x
        x = x * 6364136223846793005 + 1442695040888963407 & (1 << 64) - 1
        return (x >> 11) / 2 ** 53
    for _ in range(count):
        q = tuple(int(draw() * 2 ** bits) for _ in range(3))
        normal = tuple(draw() - 0.5 for _ in range(3))
        light = tuple(4 * draw() for _ in range(3))
        albedo = tuple(int(256 * draw()) for _ in range(3))
        surfels.append(Surfel(q, normal, 0.5 * draw(), light, albedo))
    return surfels


def distance(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)))


def across(a, b):
    """Sine of the angle between unit vectors."""
    return math.sin(angle(a, b)) if any(a) and any(b) else 1.0


def angle(a, b):
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(math.sqrt(sum(c * c for c in cross)), sum(x * y for x, y in zip(a, b)))


class Summary:
    """What a node knows of its points, before it is rounded."""

    def __init__(self, area, weighted, facing, flux):
        """weighted: (weight, position) of points or children; the weights are areas or all 1."""
        self.area, self.facing, self.flux = area, facing, flux
        weight = sum(w for w, _ in weighted)
        self.mean = tuple(sum(w * p[k] for w, p in weighted) / weight for k in range(3))
        sums = tuple(facing[2 * k] - facing[2 * k + 1] for k in range(3))
        length = math.sqrt(sum(s * s for s in sums))
        self.has_axis = length > 1e-6 * area
        self.axis = tuple(s / length for s in sums) if self.has_axis else (0.0, 0.0, 1.0)
        self.slab = self.axis if self.has_axis else (0.0, 0.0, 0.0)
        self.radius = self.half_angle = self.thick = 0.0

    def hold(self, reach, turn, height):
        self.radius = max(self.radius, reach)
        self.half_angle = max(self.half_angle, turn) if self.has_axis else math.pi
        self.thick = max(self.thick, height)

    @property
    def thickness(self):
        return min(self.thick, self.radius) if self.has_axis else self.radius

    def height(self, position):
        return abs(sum(n * (a - b) for n, a, b in zip(self.slab, position, self.mean)))


def summarise_points(surfels, unit):
    facing, flux = [0.0] * 6, [[0.0] * 3 for _ in range(6)]
    for s in surfels:
        for k in range(6):
            share = s.area * max(0.0, s.normal[k // 2] * (1 if k % 2 == 0 else -1))
            facing[k] += share
            for c in range(3):
                flux[k][c] += share * s.radiance[c]
    area = sum(s.area for s in surfels)
    out = Summary(area, [(s.area if area else 1, s.q) for s in surfels], facing, flux)
    for s in surfels:
        out.hold(distance(s.q, out.mean) + s.radius / unit, angle(s.normal, out.axis),
                 out.height(s.q) + s.radius / unit * across(s.normal, out.slab))
    return out


def summarise_nodes(nodes):
    area = sum(n.area for n in nodes)
    out = Summary(area, [(n.area if area else 1, n.mean) for n in nodes],
                  [sum(n.facing[k] for n in nodes) for k in range(6)],
                  [[sum(n.flux[k][c] for n in nodes) for c in range(3)] for k in range(6)])
    for n in nodes:
        cosine = abs(sum(a * b for a, b in zip(n.slab, out.slab)))
        height = n.thickness * cosine + n.radius * across(n.slab, out.slab)
        out.hold(distance(n.mean, out.mean) + n.radius, angle(n.axis, out.axis) + n.half_angle,
                 out.height(n.mean) + min(height, n.radius))
    return out


# Groups (nodes.md#node-group, #quantisation) -----------------------------------------------------

def slab_normal(facing):
    sums = [facing[2 * k] - facing[2 * k + 1] for k in range(3)]
    length = math.sqrt(sum(s * s for s in sums))
    return [s / length for s in sums] if length else sums


def encode_summary(node, corner, edge):
    """The columns of one child."""
    out = {}
    stored = []
    for k, name in enumerate(("mean_x", "mean_y", "mean_z")):
        step = math.floor((node.mean[k] - corner[k]) * (65536 / edge) + 0.5)
        out[name] = min(max(step, 0), 65535)
        stored.append(corner[k] + out[name] * (edge / 65536))
    moved = distance(stored, node.mean)
    radius = (node.radius + moved) * (1 + 2 ** -50)
    out["radius"] = ufloat16_up(radius)
    u, v = octahedral(node.axis, 127)
    out["cone_axis"] = u & 0xFF | (v & 0xFF) << 8
    turned = node.half_angle + angle(node.axis, unfold(u, v, 127))
    cosine = -1.0 if turned >= math.pi else math.cos(turned)
    out["cone_cos"] = max(math.floor((cosine - 4e-7) * 32767), -32767) & 0xFFFF
    out["area"] = ufloat16(node.area)
    out["facing"] = [math.floor(min(f / node.area, 1) * 65535 + 0.5) if out["area"] else 0
                     for f in node.facing]
    turned = distance(slab_normal(out["facing"]), slab_normal(node.facing))
    if not node.has_axis or not any(slab_normal(out["facing"])):
        turned = 1.0
    thickness = (node.thickness + node.radius * turned + moved) * (1 + 2 ** -50)
    out["thickness"] = ufloat16_up(min(thickness, radius))
    out["radiance"] = [rgbe([x / f for x in light]) if f and out["area"] else 0
                       for f, light in zip(node.facing, node.flux)]
    return out


def encode_group(cell, level, refs, columns):
    """Bytes of a group. refs: (interior, word); columns: of each child, from encode_summary()."""
    n = len(refs)
    mask = sum(1 << i for i, (interior, _) in enumerate(refs) if interior)
    out = struct.pack("<QQBBBBI", cell >> 63, cell & (1 << 63) - 1, level, n, mask, 0, 0)
    out += struct.pack(f"<{n}Q", *(word for _, word in refs))
    for name in r.COLUMNS:
        out += struct.pack(f"<{n}H", *(c[name] for c in columns))
    for k in range(6):
        out += struct.pack(f"<{n}H", *(c["facing"][k] for c in columns))
    for k in range(6):
        out += struct.pack(f"<{n}I", *(c["radiance"][k] for c in columns))
    return out + bytes(-len(out) % 8)


def corner_of(cell):
    return tuple(sum((cell >> 3 * b + axis & 1) << b for b in range(42)) for axis in range(3))


class Tree:
    """The octree over sorted surfels, top-down: self.groups in post-order, children by number."""

    def __init__(self, surfels, leaf_points, unit):
        self.surfels, self.leaf_points, self.unit = surfels, leaf_points, unit
        self.groups = []  # (cell, level, [(interior, number or (first, count))], [columns])
        self.digits, rank = [], 0  # keys continued by ranks: 62 octal digits
        for i, s in enumerate(surfels):
            rank = rank + 1 if i and s.key == surfels[i - 1].key else 0
            self.digits.append(s.key << 60 | rank)
        if surfels:
            child, node = self.build(0, len(surfels))
            if not child[0]:
                self.emit(0, 0, [child], [node])

    def build(self, first, last):
        """(interior, reference) and summary of the points from first to last - 1."""
        if last - first <= self.leaf_points:
            return ((False, (first, last - first)),
                    summarise_points(self.surfels[first:last], self.unit))
        differ = self.digits[first] ^ self.digits[last - 1]
        level = 62 - (differ.bit_length() + 2) // 3
        shift, children, start = 3 * (61 - level), [], first
        for i in range(first + 1, last + 1):
            if i == last or self.digits[i] >> shift != self.digits[start] >> shift:
                children.append(self.build(start, i))
                start = i
        nodes = [node for _, node in children]
        cell = r.cell_of(self.surfels[first].key, level)
        number = self.emit(cell, level, [child for child, _ in children], nodes)
        return (True, number), summarise_nodes(nodes)

    def emit(self, cell, level, refs, nodes):
        edge = float(1 << 42 - min(level, 42))
        columns = [encode_summary(node, corner_of(cell), edge) for node in nodes]
        self.groups.append([cell, level, refs, columns])
        return len(self.groups) - 1


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


def pack_columns(payload, columns, count):
    """The packed form of columns (points.md#packed-columns)."""
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
        shift = (seen & -seen).bit_length() - 1 if seen else 0
        steps = [b - a & mask for a, b in zip(numbers[:1] + numbers, numbers)]
        steps = [(d - mask - 1 if d >> column.bits - 1 else d) >> shift for d in steps]
        codes = [2 * d if d >= 0 else -2 * d - 1 for d in steps]
        planes = (max(codes).bit_length() + 7) // 8
        out += struct.pack("<BBQ", shift, planes, numbers[0])
        for k in range(planes):
            out += bytes(c >> 8 * k & 255 for c in codes)
    return out


def raw_frame(content):
    """A zstd frame, made by hand, that holds 256 to 65535 bytes as they are."""
    return (b"\x28\xb5\x2f\xfd\x60" + struct.pack("<H", len(content) - 256)
            + (len(content) << 3 | 1).to_bytes(3, "little") + content)


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
                 origin=(0.0, 0.0, 0.0)):
        self.surfels = sorted(surfels, key=lambda s: s.key)
        self.page_shift, self.leaf_points, self.origin = page_shift, leaf_points, origin
        self.head = {"major": 1, "minor": 0, "header_bytes": 4096, "incompat": 0, "ro_compat": 0,
                     "compat": 0, "uuid": UUID, "align_shift": 9, "checksum": 1,
                     "byte_order": 0x01020304, "reserved": bytes(56)}
        self.pages, self.super, self.super_b, self.directory = [], {}, {}, {}
        self.patches = []  # (offset from the start, or from the end when negative, bytes)
        self.tree = Tree(self.surfels, leaf_points, UNIT_EDGE * 2 ** -42)
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
        batches = [batch]
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

    def pack(self, page, columns, codec):
        packed = pack_columns(bytes(page.payload), columns, page.count)
        page.stored = raw_frame(packed) if codec == r.ZSTD else literal_block(packed)
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
        return struct.pack("<HHIQQQ16sBBHI56s", h["major"], h["minor"], h["header_bytes"],
                           h["incompat"], h["ro_compat"], h["compat"], h["uuid"], self.page_shift,
                           h["align_shift"], h["checksum"], h["byte_order"], h["reserved"])

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
        unit = UNIT_EDGE * 2 ** -42
        low = [min((p.q[k] for p in s), default=0) for k in range(3)]
        high = [max((p.q[k] for p in s), default=0) for k in range(3)]
        place = [tuple(o + q * unit for o, q in zip(self.origin, corner)) if s else (0.0,) * 3
                 for corner in (low, high)]
        return {"bounds_low": place[0], "bounds_high": place[1],
                "area": math.fsum(p.area for p in s),
                "flux": tuple(math.fsum(p.area * p.radiance[c] for p in s) for c in range(3))}

    def superblock(self, facts, overrides):
        f = {**facts, **overrides}
        body = r.SUPER_MAGIC + f["identity"] + struct.pack(
            "<QIIQQIIHHIIIQQQ3dd3d3dd3d2Q64s3696s", f["file_bytes"], f["page_count"],
            f["directory_pages"], f["directory_offset"], f["directory_xxh3"], f["meta_page"],
            f["root_page"], f["root_slot"], f["levels"], f["leaf_points"], f["points_per_page"],
            f["reserved"], f["points"], f["nodes"], f["node_groups"], *f["origin"], f["edge"],
            *f["bounds_low"], *f["bounds_high"], f["area"], *f["flux"], *f["content_xxh3"],
            f["writer"], f["rest"])
        return body + struct.pack("<Q", xxh3_64(body, r.SUPER_SEED))

    def facts(self):
        groups = self.tree.groups
        root = self.places[-1] if groups else (r.NO_PAGE, 0)
        return {"identity": self.identity(), "page_count": len(self.pages),
                "meta_page": len(self.pages) - 1, "root_page": root[0], "root_slot": root[1],
                "levels": max((g[1] + 1 for g in groups), default=0),
                "leaf_points": self.leaf_points, "reserved": 0, "rest": bytes(3696),
                "points_per_page": ((1 << self.page_shift) - 64) // 34 // 8 * 8,
                "points": len(self.surfels), "nodes": sum(len(g[2]) for g in groups),
                "node_groups": len(groups), "origin": self.origin, "edge": UNIT_EDGE,
                "writer": b"spec/vectors.py", **self.totals()}

    def to_bytes(self):
        head = r.FILE_MAGIC + self.identity()
        out = head + struct.pack("<Q", xxh3_64(head, r.HEADER_SEED))
        out += bytes(r.BLOCK - len(out))
        entries, records = b"", b""
        for i, page in enumerate(self.pages):
            fields, stored = page.fields(i)
            e = {**fields, "offset": len(out), **page.entry}
            out += self.page_image(page, {**fields, **page.header}, stored)
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


def write_all(directory):
    """Writes all vectors; the number of an exit code."""
    import vectors_list
    made = 0
    for kind, name, draft in vectors_list.all_vectors(shutil.which("zstd") is not None):
        folder = os.path.join(directory, kind)
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(folder, name + ".ptcx"), "wb") as file:
            file.write(draft if isinstance(draft, bytes) else draft.to_bytes())
        made += 1
    print(made, "vectors written")
    return 0
