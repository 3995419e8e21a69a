"""Scenes of parts (parts.md): good ones, and those that readers or verifiers refuse.

A list of them has the parts as well, whose names begin with "parts/", the folder in which they lie. Parts are files
without a fault, but for two that are damaged on purpose.
"""

import reader as r
from vectors import UUID, Draft, Page, channel
from vectors_good import changed
from vectors_tree import Surfel, scatter

CHANNELS = (channel("occlusion", 1, 1, 1),)


class Scene(Draft):
    """A scene whose parts hold the points between the cuts. Its tree is that of a file with all points.

    `records` and the groups of `top` may be changed before the scene becomes bytes."""

    def __init__(self, surfels, cuts, name, **options):
        super().__init__(surfels, **options)
        whole, ends = self.tree.groups, [0, *cuts, len(self.surfels)]
        self.ranges = list(zip(ends, ends[1:]))
        self.parts = [self.part(i, options) for i in range(len(self.ranges))]
        self.files = [(f"parts/{name}.{i}", part) for i, part in enumerate(self.parts)]
        self.head["incompat"] |= r.HAS_PARTS
        self.records = [self.record(i) for i in range(len(self.parts))]
        self.records_per_page = ((1 << self.page_shift) - 64) // r.PART_BYTES
        self.take_top(whole)
        self.pages = self.pages[-1:]
        self.lay_out()

    def part(self, i, options):
        first, end = self.ranges[i]
        part = Draft(self.surfels[first:end], **options)
        part.head["uuid"] = bytes([0x50 + i]) + UUID[1:]
        return part

    def record(self, i):
        part, (first, end) = self.parts[i], self.ranges[i]
        bytes_ = part.to_bytes()
        keys = [half for s in (part.surfels[0], part.surfels[-1]) for half in (s.key >> 63, s.key & (1 << 63) - 1)]
        return {"uuid": part.head["uuid"], "superblock_xxh3": int.from_bytes(bytes_[-8:], "little"),
                "file_bytes": len(bytes_), "first_point": first, "points": end - first,
                "node_pages": part.facts()["node_pages"], "keys": keys, "zeros": bytes(40),
                "name": self.files[i][0].encode() + b".ptcx"}

    def take_top(self, groups):
        """Keeps the root and the groups that have points of two parts."""
        runs, own = [], {}
        for _, _, refs, _ in groups:
            ends = [runs[where] if interior else (where[0], sum(where)) for interior, where in refs]
            runs.append((ends[0][0], ends[-1][1]))
        places = {(first + begin, first + end): (i, number)
                  for i, (part, (first, _)) in enumerate(zip(self.parts, self.ranges))
                  for number, (begin, end) in enumerate(runs_of(part.tree.groups))}
        self.top = []
        for number, (cell, level, refs, columns) in enumerate(groups):
            inside = any(first <= runs[number][0] and runs[number][1] <= end for first, end in self.ranges)
            if not inside or number == self.tree.root:
                refs = [(i, where if not i else own.get(where, places.get(runs[where]))) for i, where in refs]
                own[number] = len(self.top)
                self.top.append([cell, level, refs, columns])
        self.tree.groups, self.tree.root = self.top, len(self.top) - 1

    def lay_out(self):
        """Writes node pages and parts pages before the meta page."""
        meta, self.pages = self.pages[-1], []
        self.add_nodes()
        pages = len(self.batches)
        for record, part in zip(self.records, self.parts):
            record.setdefault("first_node_page", pages)
            pages += part.facts()["node_pages"]
        for i in range(0, len(self.records), self.records_per_page):
            some = self.records[i:i + self.records_per_page]
            self.pages.append(Page(r.PARTS, b"".join(map(pack_record, some)), len(some),
                                   keys=(some[0]["keys"][0], max(some[-1]["keys"][2], some[0]["keys"][0]))))
        self.pages.append(meta)
        return self

    def word(self, interior, where):
        if interior and isinstance(where, tuple):
            part, number = where
            page, slot = self.parts[part].places[number]
            before = sum(p.facts()["node_pages"] for p in self.parts[:part])
            return len(self.batches) + before + page | slot << 32
        return super().word(interior, where)

    def facts(self):
        out = super().facts()
        for part in self.parts:
            facts = part.facts()
            out["nodes"] += facts["nodes"]
            out["node_groups"] += facts["node_groups"]
            out["levels"] = max(out["levels"], facts["levels"])
        return out


def runs_of(groups):
    """First point and end of each group of a tree in post-order."""
    out = []
    for _, _, refs, _ in groups:
        ends = [out[where] if interior else (where[0], sum(where)) for interior, where in refs]
        out.append((ends[0][0], ends[-1][1]))
    return out


def pack_record(f):
    return r.PART.pack(f["uuid"], f["superblock_xxh3"], f["file_bytes"], f["first_point"], f["points"],
                       f["first_node_page"], f["node_pages"], *f["keys"], f["zeros"], f["name"])


def leaves(surfels, leaf_points):
    """Where leaves begin in the tree over all points: parts are cut there."""
    tree = Draft(surfels, leaf_points=leaf_points).tree
    return sorted(where[0] for group in tree.groups for interior, where in group[2] if not interior)


def two_parts(**options):
    """Groups of both parts, some of the top among them, and leaves of the top; part 0 ends within a page."""
    surfels = scatter(130, 5)
    options = {"leaf_points": 2, **options}
    begins = leaves(surfels, options["leaf_points"])
    return Scene(surfels, [begins[len(begins) * 2 // 5]], "two-parts", **options)


def as_one(**options):
    return Draft(scatter(130, 5), **{"leaf_points": 2, **options})


def three_parts():
    """The second part has one leaf, so that its root group is not part of the scene's tree."""
    surfels = scatter(130, 7)
    begins = leaves(surfels, 8)
    scene = Scene(surfels, begins[5:7], "three-parts", channels=CHANNELS)
    for k, part in enumerate(scene.parts):
        for page in part.pages:
            if page.type == r.ATTRIBUTE:
                page.payload = bytearray((40 * k + i) % 256 for i in range(page.count))
    return refreshed(scene)


def refreshed(scene):
    """A scene whose records are those of its parts as they are now."""
    scene.records = [scene.record(i) for i in range(len(scene.parts))]
    return scene.lay_out()


def eleven_parts():
    """One record more than a parts page of 4 KiB holds; each part has one point."""
    return Scene([Surfel((i << 38, 0, 0), radius=1, radiance=(1, 2, 3)) for i in range(11)], range(1, 11),
                 "parts-on-two-pages", leaf_points=1)


def one_part():
    """A scene with one part has a root group of its own."""
    return Scene(scatter(20, 4), [], "one-part")


def with_files(name, scene):
    yield name, scene
    yield from scene.files


def good():
    yield from with_files("two-parts", two_parts())
    yield "two-parts-as-one-file", as_one()
    yield from with_files("three-parts", three_parts())
    yield from with_files("parts-on-two-pages", eleven_parts())
    yield from with_files("one-part", one_part())


# What is refused ---------------------------------------------------------------------------------

def pair(far=1 << 41, name="pair", **options):
    """Two pairs of points: the top is the root, whose children are the root groups of two parts."""
    surfels = [Surfel((x + dx, 0, 0), radius=1) for x in (0, far) for dx in (0, 1 << 30)]
    return Scene(surfels, [2], name, **{"leaf_points": 1, **options})


def changed_record(which=1, **fields):
    scene = pair()
    scene.records[which].update(fields)
    return scene.lay_out()


def with_points(points, sum_):
    """A scene whose last record has this many points, and whose superblock has this sum."""
    return changed(changed_record(points=points), lambda d: d.super.update(points=sum_))


def changed_top(change, scene=None):
    scene = scene or pair()
    change(scene.top)
    return scene.lay_out()


def bad_page():
    rule = "parts-parts-page"
    none = pair()
    none.pages = [page for page in none.pages if page.type != r.PARTS]
    yield rule, none
    points = pair()
    points.pages.insert(0, points.parts[0].pages[0])
    yield rule + ".points", points
    short = pair()
    short.records_per_page = 1
    yield rule + ".not-full", short.lay_out()


def bad_count():
    rule = "parts-parts-count"
    yield rule, changed_record(first_point=1)
    yield rule + ".first", changed_record(0, first_point=1)
    yield rule + ".node-pages", changed_record(first_node_page=9)
    yield rule + ".superblock", changed(pair(), lambda d: d.super.update(points=5))
    yield rule + ".empty", with_points(0, 2)
    yield rule + ".points-above", changed_record(points=(1 << 48) - 1)
    yield rule + ".points-wrap", with_points((1 << 64) - 1, 1)
    yield rule + ".node-pages-above", changed_record(node_pages=(1 << 32) - 3)
    yield rule + ".node-pages-wrap", changed_record(node_pages=(1 << 32) - 1)


def bad_order():
    rule = "parts-parts-order"
    keys = [record["keys"] for record in pair().records]
    yield rule, changed_record(keys=keys[1][2:] + keys[1][:2])
    yield rule + ".between", changed_record(0, keys=keys[0][:2] + [keys[1][0], keys[1][1] + 1])
    yield rule + ".same-key", changed_record(0, keys=keys[0][:2] + keys[1][:2])
    yield rule + ".bit-63", changed_record(keys=keys[1][:3] + [1 << 63])


def bad_name():
    for case, name in (("", b"/parts/pair.1.ptcx"), (".up", b"../parts/pair.1.ptcx"),
                       (".up-within", b"parts/../parts/pair.1.ptcx"), (".here", b"./parts/pair.1.ptcx"),
                       (".empty-step", b"parts//pair.1.ptcx"), (".folder", b"parts/"), (".none", b""),
                       (".text", b"parts/\xff.ptcx"), (".behind", b"parts/pair.1.ptcx\0x"),
                       (".unended", b"x" * 256), (".twice", b"parts/pair.0.ptcx")):
        yield "parts-parts-name" + case, changed_record(name=name)


def bad_file():
    rule = "parts-parts-file"
    keys = [record["keys"] for record in pair().records]
    scene = pair()
    for name, file in scene.files:
        yield name, file
    yield rule, changed_record(name=b"parts/missing.ptcx")
    yield rule + ".folder", changed_record(name=b"parts")
    yield rule + ".itself", changed_record(name=rule.encode() + b".itself.ptcx")
    yield rule + ".uuid", changed_record(uuid=UUID[::-1])
    yield rule + ".length", changed_record(file_bytes=scene.records[1]["file_bytes"] + r.BLOCK)
    yield rule + ".superblock", changed_record(superblock_xxh3=1)
    yield rule + ".points", with_points(3, 5)
    yield rule + ".node-pages", changed_record(node_pages=2)
    yield rule + ".first-key", changed_record(keys=[keys[1][0] - 1, *keys[1][1:]])
    yield rule + ".last-key", changed_record(keys=[*keys[1][:2], keys[1][2] + 1, keys[1][3]])
    for case, options in (("frame", {"edge": 2.0 ** 23}), ("origin", {"origin": (1.0, 0.0, 0.0)}),
                          ("page-size", {"page_shift": 13}), ("point-bytes", {"point_bytes": 40}),
                          ("leaf-points", {"leaf_points": 2}), ("channels", {"channels": CHANNELS})):
        part = pair(**options).parts[0] if case == "leaf-points" else pair(**options).parts[1]
        scene = pair()
        k = 0 if case == "leaf-points" else 1
        scene.parts[k] = part
        scene.files[k] = (f"parts/other-{case}", part)
        yield f"{rule}.{case}", refreshed(scene)
        yield scene.files[k]


def bad_rest():
    yield "parts-parts-zero", changed_record(zeros=b"\1" + bytes(39))
    yield "parts-parts-zero.last", changed_record(zeros=bytes(39) + b"\1")
    top = "parts-parts-top"
    beyond = pair()
    beyond.parts[1].places[0] = (0, 7)
    yield top, beyond.lay_out()
    yield top + ".two-parts", changed_top(lambda g: g[0][2].__setitem__(1, (False, (1, 2))))
    yield "nodes-node-reference.of-parts", changed_top(lambda g: g[0][2].__setitem__(1, (True, (1, 0))),
                                                       far_page())
    yield "nodes-node-leaf.of-parts", changed_top(lambda g: g[0][2].__setitem__(1, (False, (3, 2))))
    yield "nodes-references.of-parts", changed(pair(), own_slot)
    yield "container-superblock-counts.of-parts", changed(pair(), lambda d: d.super.update(node_groups=4, nodes=6))
    yield "container-superblock-root.of-a-part", changed(pair(), lambda d: d.super.update(root_page=1))
    damaged = pair()
    part = damaged.parts[0]
    damaged.files[0] = ("parts/damaged", part)
    part.patches.append((part.offset(0) + 64 + 20, b"X"))
    yield "container-page-payload.of-a-part", refreshed(damaged)
    yield damaged.files[0]


def far_page():
    scene = pair()
    scene.parts[1].places[0] = (1, 0)
    return scene


def own_slot(scene):
    scene.tree.groups[0][2][1] = (True, 0)
    scene.places[0] = (0, 7)
    scene.pages[0] = scene.node_page(scene.batches[0])
    scene.places[0] = (0, 0)


def bad():
    for source in (bad_page, bad_count, bad_order, bad_name, bad_file, bad_rest):
        yield from source()


def wider(groups):
    """Takes the next larger cell for the root, in which all points lie in one octant."""
    groups[0][1] -= 1
    for columns in groups[0][3]:
        columns["mean_x"] //= 2


def below_a_group(scene):
    """Leads the root's first child to a group below the right one, so that the first points have no leaf."""
    refs = scene.top[-1][2]
    runs = runs_of(scene.parts[0].tree.groups)
    end = runs[refs[0][1][1]][1]
    refs[0] = (True, (0, next(k for k, run in enumerate(runs) if 0 < run[0] and run[1] <= end)))
    scene.lay_out()


def island(scene):
    """Adds a group that is no child of any."""
    scene.top.insert(0, list(scene.top[0]))
    scene.tree.root = 1
    scene.lay_out()


def verify():
    yield from pair().files
    keys = pair().records[1]["keys"]
    yield "parts-parts-file", changed_record(keys=[*keys[:3], keys[3] + 1])
    top = "parts-parts-top"

    def swap(groups):
        groups[0][2].reverse()
    yield top, changed_top(swap)
    yield top + ".twice", changed_top(lambda g: g[0][2].__setitem__(1, g[0][2][0]))
    yield top + ".level", changed_top(lambda g: g[0].__setitem__(1, 13))
    yield top + ".cell", changed_top(lambda g: g[0].__setitem__(slice(0, 2), [r.interleave(3 << 40, 0, 0), 2]))
    yield top + ".point", changed_top(lambda g: g[0][2].__setitem__(1, (False, (3, 1))))
    yield top + ".great-leaf", changed_top(lambda g: g[0][2].__setitem__(1, (False, (2, 2))))
    near = pair(1 << 40, "near-pair")
    yield top + ".octants", changed_top(wider, near)
    yield from near.files
    yield from with_files(top + ".skipped-points", changed(two_parts(), below_a_group))
    yield "nodes-references.of-parts", changed(pair(), island)
    yield "container-superblock-totals.of-parts-bounds", changed(
        pair(), lambda d: d.super.update(bounds_low=(-1.0, 0.0, 0.0)))
    yield top + ".run", changed_top(lambda g: g[0][2].__setitem__(0, (False, (1, 1))))
    padded = pair()
    part = padded.parts[0]
    part.patches.append((part.offset(0) + 64 + 2 * 34, b"\1"))
    padded.files[0] = ("parts/padded", part)
    yield "container-padding.of-a-part", refreshed(padded)
    yield padded.files[0]
    yield "container-superblock-counts.of-parts", changed(pair(), lambda d: d.super.update(nodes=5))
    yield "container-superblock-root.of-parts", changed(pair(), lambda d: d.super.update(levels=20))
    yield "container-superblock-totals.of-parts", changed(pair(), lambda d: d.super.update(area=9.0))
    yield "container-page-keys.parts", changed(pair(), lambda d: setattr(d.pages[-2], "keys", (0, 0)))
