"""The whole-file check: every byte and every rule but those on summaries (container.md#verify)."""

import math
import struct
from array import array

from reader import (ATTRIBUTE, BLOCK, CHANNEL_BYTES, ENTRY_BYTES, NODE, PAGE_HEADER_BYTES, POINT,
                    Broken, Points, cell_of, decode_groups, entries_per_page, open_container,
                    page_size, require, to_position)


class Verifier:
    """A container and what was found in it so far."""

    BATCH = 128  # pages that one zstd process decodes

    def __init__(self, container):
        self.c = container
        self.keys = [array("Q"), array("Q")]  # high and low halves, by point number
        self.groups = {}
        self.undecoded = 0
        self.area, self.flux = [], ([], [], [])
        self.low, self.high = None, None

    def run(self):
        c = self.c
        copies = list(c.superblock_copies())
        for _, found in copies:
            if isinstance(found, Broken):
                raise found
        order = c.point_pages + [i for i in range(c.superblock.page_count)
                                 if c.entries[i].type != POINT]  # points by their numbers
        for k in range(0, len(order), self.BATCH):
            pages = order[k:k + self.BATCH]
            loaded = c.load(pages)
            for page in pages:
                if page in loaded:
                    self.check_page(page, c.headers[page], loaded[page])
                else:
                    self.undecoded += 1
        self.check_padding()
        if self.undecoded == 0:
            self.check_tree()
            self.check_totals()

    def check_padding(self):
        c, s, end = self.c, self.c.superblock, BLOCK
        used = sorted((e.offset, e.offset + PAGE_HEADER_BYTES + e.stored_bytes) for e in c.entries)
        last = s.page_count - (s.directory_pages - 1) * entries_per_page(c.header)
        used.append((s.directory_offset, s.directory_offset
                     + (s.directory_pages - 1) * page_size(c.header) + 64 + ENTRY_BYTES * last))
        for start, after in used + [(c.file_bytes - 2 * BLOCK, 0)]:
            for at in range(end, start, 1 << 20):
                gap = c.read(at, min(1 << 20, start - at))
                require(not gap.strip(b"\0"), at, "spec/container.md#padding",
                        "a byte between pages is not zero")
            end = after

    def check_page(self, page, header, payload):
        at = self.c.payload_at(page)
        keys = "spec/container.md#page-keys"
        if header.type == POINT:
            points = Points(payload, header.record_count, at)
            require((points.keys[0] >> 63, points.keys[-1] >> 63)
                    == (header.first_key, header.last_key), at - 32, keys,
                    "keys are not those of the points")
            self.add_points(points, at)
        elif header.type == NODE:
            s = self.c.superblock
            groups = decode_groups(payload, header.record_count, at, s.page_count, s.points)
            require(min(g.level for g in groups) == header.level, at - 42,
                    "spec/container.md#page-level", "level is not the least of the groups")
            highs = [g.cell >> 63 for g in groups]
            require((min(highs), max(highs)) == (header.first_key, header.last_key), at - 32, keys,
                    "keys are not those of the groups")
            self.check_targets(groups, at)
            self.groups[page] = groups
        elif header.type == ATTRIBUTE:
            self.check_values(header, payload, at)

    def check_targets(self, groups, at):
        entries = self.c.entries
        for group in groups:
            for child in group.children:
                if child.interior:
                    target = entries[child.page]
                    require(target.type == NODE and child.slot < target.record_count,
                            at + group.at, "spec/nodes.md#references", "a child is no group")

    def check_values(self, header, payload, at):
        before = 0
        for channel in self.c.meta.channels:
            if channel.group != header.group:
                continue
            count = channel.components * header.record_count
            if channel.type in (3, 4):
                form, infinity = ("H", 0x7C00) if channel.type == 3 else ("I", 0x7F800000)
                values = struct.unpack_from(f"<{count}{form}", payload, before)
                require(all(v & infinity != infinity for v in values), at + before,
                        "spec/points.md#attribute-pages", "a value is not finite")
            before += count * CHANNEL_BYTES[channel.type]

    def add_points(self, points, at):
        if self.keys[0]:
            last = self.keys[0][-1] << 63 | self.keys[1][-1]
            require(last <= points.keys[0], at, "spec/points.md#point-order",
                    "page starts before the last point of the one before")
        self.keys[0].extend(k >> 63 for k in points.keys)
        self.keys[1].extend(k & (1 << 63) - 1 for k in points.keys)
        area = [2 * r * r for r in points.radius]
        self.area.append(math.fsum(area))
        for sums, radiance in zip(self.flux, points.radiance):
            sums.append(math.fsum(a * v for a, v in zip(area, radiance)))
        axes = (points.x, points.y, points.z)
        low, high = list(map(min, axes)), list(map(max, axes))
        self.low = low if self.low is None else list(map(min, self.low, low))
        self.high = high if self.high is None else list(map(max, self.high, high))

    def check_totals(self):
        s, tail = self.c.superblock, self.c.file_bytes - 2 * BLOCK
        clause = "spec/container.md#superblock-totals"
        found = [math.fsum(self.area), *map(math.fsum, self.flux)]
        for said, sum_ in zip((s.area, *s.flux), found):
            require(math.isclose(said, sum_, rel_tol=1e-6, abs_tol=0), tail, clause,
                    f"superblock's {said} is not the sum {sum_}")
        low = to_position(self.c.header, self.low) if s.points else (0, 0, 0)
        high = to_position(self.c.header, self.high) if s.points else (0, 0, 0)
        require((s.bounds_low, s.bounds_high) == (low, high), tail, clause,
                "bounds are not those of the points")

    def key(self, point):
        return self.keys[0][point] << 63 | self.keys[1][point]

    def group_at(self, page, slot):
        group = self.groups[page][slot]
        return group, self.c.payload_at(page) + group.at

    def check_tree(self):  # nodes.md#verify
        s = self.c.superblock
        if s.points == 0:
            return
        tail = self.c.file_bytes - 2 * BLOCK
        self.reached, self.next_point, self.nodes, self.levels = set(), 0, 0, 0
        root, at = self.group_at(s.root_page, s.root_slot)
        if len(root.children) == 1:
            require(root.level == 0 and not root.children[0].interior, at,
                    "spec/nodes.md#node-children", "root with one child is no leaf at level 0")
        path = [self.enter(s.root_page, s.root_slot)]
        while path:
            step = next(path[-1], None)
            if step is None:
                path.pop()
            else:
                path.append(self.enter(*step))
        require(len(self.reached) == s.node_groups, tail, "spec/nodes.md#references",
                "a group is the child of no node")
        counts = "spec/container.md#superblock-counts"
        require(self.next_point == s.points, tail, counts, "leaves do not hold all points")
        require(self.nodes == s.nodes, tail, counts, f"tree has {self.nodes} nodes")
        require(self.levels == s.levels, tail, "spec/container.md#superblock-root",
                f"tree has {self.levels} levels")

    def enter(self, page, slot):
        """Visits a group; yields its interior children, checked against it."""
        s = self.c.superblock
        group, at = self.group_at(page, slot)
        self.reached.add((page, slot))
        self.nodes += len(group.children)
        self.levels = max(self.levels, group.level + 1)
        before, start = -1, self.next_point
        for child in group.children:
            if child.interior:
                below, below_at = self.group_at(child.page, child.slot)
                require((child.page, child.slot) not in self.reached, below_at,
                        "spec/nodes.md#references", "group is the child of two nodes")
                require(below.level > group.level, below_at, "spec/nodes.md#node-level",
                        "level is not below the parent's")
                require(len(below.children) >= 2, below_at, "spec/nodes.md#node-children",
                        "group has one child and is not the root")
                first = last = below.cell
                yield child.page, child.slot
            else:
                first, last = self.take_leaf(child, at)
            require(cell_of(first, group.level) == group.cell == cell_of(last, group.level), at,
                    "spec/nodes.md#node-cell", "child lies outside the cell")
            if group.level < 42 and len(group.children) > 1:
                shift = 3 * (41 - group.level)
                require(before < first >> shift == last >> shift, at,
                        "spec/nodes.md#node-children", "children are not in octants in order")
                before = last >> shift
        require(len(group.children) == 1 or self.next_point - start > s.leaf_points, at,
                "spec/nodes.md#node-leaf", "group splits points that are a leaf")

    def take_leaf(self, child, at):
        clause = "spec/nodes.md#node-leaf"
        require(child.first == self.next_point, at, clause, "leaves do not follow each other")
        require(child.count <= self.c.superblock.leaf_points, at, clause,
                "leaf has more than leaf_points points")
        self.next_point += child.count
        return self.key(child.first), self.key(child.first + child.count - 1)


def verify(path):
    """Checks a file whole; facts for people and machines. Raises Broken or OSError."""
    container = open_container(path)
    try:
        verifier = Verifier(container)
        verifier.run()
        s = container.superblock
        return {"valid": True, "points": s.points, "nodes": s.nodes, "groups": s.node_groups,
                "levels": s.levels, "pages": s.page_count, "bytes": s.file_bytes,
                "channels": [c.name for c in container.meta.channels],
                "content": f"{s.content_xxh3[1]:016x}{s.content_xxh3[0]:016x}",
                "undecoded_pages": verifier.undecoded}
    finally:
        container.close()
