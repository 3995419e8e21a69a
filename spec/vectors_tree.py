"""Surfels and the octree over them, for the files that vectors.py writes."""

import math
import struct

import reader as r

FLOAT_MAX = struct.unpack("<f", struct.pack("<I", 0x7F7FFFFF))[0]


# Types (README.md#types) -------------------------------------------------------------------------

def half(x):
    return struct.unpack("<H", struct.pack("<e", min(x, 65504.0)))[0]


def float_bits(x):
    return struct.unpack("<I", struct.pack("<f", min(x, FLOAT_MAX)))[0]


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
    a, b = max(u, -q), max(v, -q)
    c = q - abs(a) - abs(b)
    if c < 0:
        a, b = (q - abs(b)) * (-1 if a < 0 else 1), (q - abs(a)) * (-1 if b < 0 else 1)
    length = math.sqrt(a * a + b * b + c * c)
    return a / length, b / length, c / length


# Points and their summaries (points.md, nodes.md#summary) ----------------------------------------

class Surfel:
    """A surfel at a lattice point."""

    def __init__(self, q, normal=(0, 0, 1), radius=0.0, radiance=(0, 0, 0), albedo=(0, 0, 0),
                 uv=None, emission=(0, 0, 0)):
        self.q, self.albedo = q, albedo
        self.key = r.interleave(*q)
        self.uv = uv or octahedral(normal, 32767)
        self.normal = unfold(*self.uv, 32767)
        self.radius = struct.unpack("<f", struct.pack("<f", radius))[0]
        self.half = tuple(map(half, radiance))
        self.radiance = tuple(map(r.half_to_float, self.half))
        self.own = tuple(map(half, emission))
        self.emission = tuple(map(r.half_to_float, self.own))
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

    def __init__(self, area, weighted, facing, flux, power, greatest, emits):
        """weighted: (weight, position) of points or children; the weights are areas or all 1."""
        self.area, self.facing, self.flux, self.power = area, facing, flux, power
        self.greatest, self.emits = greatest, emits
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
    facing, flux, power = [0.0] * 6, [[0.0] * 3 for _ in range(6)], [[0.0] * 3 for _ in range(6)]
    for s in surfels:
        for k in range(6):
            share = s.area * max(0.0, s.normal[k // 2] * (1 if k % 2 == 0 else -1))
            facing[k] += share
            for c in range(3):
                flux[k][c] += share * s.radiance[c]
                power[k][c] += share * s.emission[c]
    area = sum(s.area for s in surfels)
    out = Summary(area, [(s.area if area else 1, s.q) for s in surfels], facing, flux, power,
                  max(s.radius for s in surfels) / unit, any(any(s.own) for s in surfels))
    for s in surfels:
        out.hold(distance(s.q, out.mean) + s.radius / unit, angle(s.normal, out.axis),
                 out.height(s.q) + s.radius / unit * across(s.normal, out.slab))
    return out


def summarise_nodes(nodes):
    area = sum(n.area for n in nodes)
    out = Summary(area, [(n.area if area else 1, n.mean) for n in nodes],
                  [sum(n.facing[k] for n in nodes) for k in range(6)],
                  [[sum(n.flux[k][c] for n in nodes) for c in range(3)] for k in range(6)],
                  [[sum(n.power[k][c] for n in nodes) for c in range(3)] for k in range(6)],
                  max(n.greatest for n in nodes), any(n.emits for n in nodes))
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
    out["greatest"] = ufloat16_up(node.greatest)
    for name, sums in (("radiance", node.flux), ("emission", node.power)):
        out[name] = [rgbe([x / f for x in light]) if f and out["area"] else 0
                     for f, light in zip(node.facing, sums)]
    out["emits"] = node.emits
    return out


def encode_group(cell, level, refs, columns):
    """Bytes of a group. refs: (interior, word); columns: of each child, from encode_summary()."""
    n = len(refs)
    mask = sum(1 << i for i, (interior, _) in enumerate(refs) if interior)
    emits = any(c["emits"] for c in columns)
    out = struct.pack("<QQBBBBI", cell >> 63, cell & (1 << 63) - 1, level, n, mask, emits, 0)
    out += struct.pack(f"<{n}Q", *(word for _, word in refs))
    for name in r.COLUMNS:
        out += struct.pack(f"<{n}H", *(c[name] for c in columns))
    for k in range(6):
        out += struct.pack(f"<{n}H", *(c["facing"][k] for c in columns))
    for name in ("radiance", "emission") if emits else ("radiance",):
        for k in range(6):
            out += struct.pack(f"<{n}I", *(c[name][k] for c in columns))
    return out + bytes(-len(out) % 8)


def corner_of(cell):
    return tuple(sum((cell >> 3 * b + axis & 1) << b for b in range(42)) for axis in range(3))


class Tree:
    """The octree over sorted surfels, top-down: self.groups in post-order, children by number."""

    def __init__(self, surfels, leaf_points, unit):
        self.surfels, self.leaf_points, self.unit = surfels, leaf_points, unit
        self.groups = []  # [cell, level, [(interior, number or (first, count))], [columns]]
        self.digits, rank = [], 0  # keys continued by ranks: 62 octal digits
        for i, s in enumerate(surfels):
            rank = rank + 1 if i and s.key == surfels[i - 1].key else 0
            self.digits.append(s.key << 60 | rank)
        if surfels:
            child, node = self.build(0, len(surfels))
            if not child[0]:
                self.emit(0, 0, [child], [node])
        self.root = len(self.groups) - 1

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
