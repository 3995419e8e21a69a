"""The whole-file check: every byte and every rule but those on summaries (container.md#verify)."""

import math
from array import array

from reader import (BLOCK, ENTRY_BYTES, NODE, PAGE_HEADER_BYTES, PARTS, PARTS_FILE, PARTS_TOP, POINT,
                    Broken, Points, cell_of, entries_per_page, in_file, is_void, open_container, page_size,
                    require, to_position)


class Verifier:
    """A container and what was found in it so far; of a scene of parts (parts.md) also its parts, one by one."""

    BATCH = 128  # pages that one zstd process decodes

    def __init__(self, container):
        self.c = container
        self.keys = [array("Q"), array("Q")]  # high and low halves, by point number
        self.groups = {}
        self.runs = {}  # first point and end of each group that was reached
        self.parts = []
        self.undecoded = 0
        self.area, self.flux = [], ([], [], [])
        self.low, self.high = None, None

    def run(self):
        c = self.c
        copies = list(c.superblock_copies())
        for _, found in copies:
            if isinstance(found, Broken):
                raise found
        for part, record in zip(c.parts, c.records):
            self.add_part(part, record)
        order = range(c.superblock.page_count)  # points come first
        for k in range(0, len(order), self.BATCH):
            pages = order[k:k + self.BATCH]
            loaded = c.load(pages)
            for page in pages:
                if c.headers[page] is None:
                    continue  # a void page
                if page in loaded:
                    self.check_page(page, c.headers[page], loaded[page])
                else:
                    self.undecoded += 1
        self.check_padding()
        if self.undecoded == 0:
            self.check_tree()
            self.check_totals()

    def add_part(self, part, record):
        """Verifies a part as a file of its own and adds up what it holds."""
        self.parts.append(found := Verifier(part))
        try:
            found.run()
            require(found.undecoded or (found.key(0), found.key(record.points - 1))
                    == (record.first_key, record.last_key), 0, PARTS_FILE,
                    "part is not the one that the scene names: other keys")
        except Broken as error:
            raise in_file(part.path, error)
        self.undecoded += found.undecoded
        self.area += found.area
        for sums, more in zip(self.flux, found.flux):
            sums += more
        if found.low:
            self.hold(found.low, found.high)

    def check_padding(self):
        c, s, end = self.c, self.c.superblock, BLOCK
        used = [(e.offset, e.offset + PAGE_HEADER_BYTES + e.stored_bytes)
                for e in c.entries if not is_void(e)]
        last = s.page_count - (s.directory_pages - 1) * entries_per_page(c.header)
        used.append((s.directory_offset, s.directory_offset
                     + (s.directory_pages - 1) * page_size(c.header) + 64 + ENTRY_BYTES * last))
        for start, after in sorted(used) + [(c.file_bytes - 2 * BLOCK, 0)]:
            for at in range(end, start, 1 << 20):
                gap = c.read(at, min(1 << 20, start - at))
                require(not gap.strip(b"\0"), at, "spec/container.md#padding",
                        "a byte between pages is not zero")
            end = after

    def check_page(self, page, header, payload):
        at = self.c.payload_at(page)
        keys = "spec/container.md#page-keys"
        if header.type == POINT:
            points = Points(payload, header.record_count, at, self.c.header.point_bytes)
            require((points.keys[0] >> 63, points.keys[-1] >> 63)
                    == (header.first_key, header.last_key), at - 32, keys,
                    "keys are not those of the points")
            self.add_points(points, at)
        elif header.type == NODE:
            groups = self.c.decode_nodes(page, payload)
            require(min(g.level for g in groups) == header.level, at - 40,
                    "spec/container.md#page-level", "level is not the least of the groups")
            highs = [g.cell >> 63 for g in groups]
            require((min(highs), max(highs)) == (header.first_key, header.last_key), at - 32, keys,
                    "keys are not those of the groups")
            self.groups[header.rank] = groups
        elif header.type == PARTS:
            parts = [r for r in self.c.records if at <= r.at < at + len(payload)]
            require((parts[0].first_key >> 63, parts[-1].last_key >> 63) == (header.first_key, header.last_key),
                    at - 32, keys, "keys are not those of the parts")

    def add_points(self, points, at):
        if self.keys[0]:
            last = self.keys[0][-1] << 63 | self.keys[1][-1]
            require(last <= points.keys[0], at, "spec/points.md#point-order",
                    "page starts before the last point of the one before")
        self.keys[0].extend(k >> 63 for k in points.keys)
        self.keys[1].extend(k & (1 << 63) - 1 for k in points.keys)
        area = [2 * r * r for r in points.radius]
        self.area.append(math.fsum(area))
        for sums, radiance, emission in zip(self.flux, points.radiance, points.emission):
            sums.append(math.fsum(a * (v + w) for a, v, w in zip(area, radiance, emission)))
        axes = (points.x, points.y, points.z)
        self.hold(list(map(min, axes)), list(map(max, axes)))

    def hold(self, low, high):
        """Adds points with these least and greatest coordinates."""
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
        if self.parts:
            part = self.c.part_of_point(point)
            return self.parts[part].key(point - self.c.records[part].first_point)
        return self.keys[0][point] << 63 | self.keys[1][point]

    def group_at(self, page, slot):
        """A group and where it lies in its file, which may be a part."""
        part = self.c.part_of_node_page(page)
        if part >= 0:
            return self.parts[part].group_at(page - self.c.records[part].first_node_page, slot)
        group = self.groups[page][slot]
        return group, self.c.payload_at(self.c.node_pages[page]) + group.at

    def is_in_part(self, child):
        """Whether a child of a group of this file is a part's group or leads to a part's points."""
        return bool(self.parts) and (not child.interior or child.page >= self.c.superblock.node_pages)

    def check_tree(self):  # nodes.md#verify; parts.md#parts-top
        s = self.c.superblock
        if s.points == 0:
            return
        tail = self.c.file_bytes - 2 * BLOCK
        self.reached, self.next_point = set(), 0
        self.nodes = sum(part.nodes for part in self.parts)
        self.levels = max((part.levels for part in self.parts), default=0)
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
        own = sum(page < s.node_pages for page, _ in self.reached)
        require(own == self.c.own_groups, tail, "spec/nodes.md#references",
                "a group is the child of no node")
        counts = "spec/container.md#superblock-counts"
        require(self.next_point == s.points, tail, counts, "leaves do not hold all points")
        require(self.nodes == s.nodes, tail, counts, f"tree has {self.nodes} nodes")
        require(self.levels == s.levels, tail, "spec/container.md#superblock-root",
                f"tree has {self.levels} levels")

    def enter(self, page, slot):
        """Visits a group; yields its interior children of this file, checked against it."""
        s = self.c.superblock
        group, at = self.group_at(page, slot)
        self.reached.add((page, slot))
        self.nodes += len(group.children)
        self.levels = max(self.levels, group.level + 1)
        before, start = -1, self.next_point
        for child in group.children:
            def rule(anchor, child=child):
                return PARTS_TOP if self.is_in_part(child) else f"spec/nodes.md#{anchor}"
            if child.interior:
                below, below_at = self.group_at(child.page, child.slot)
                place = at if self.is_in_part(child) else below_at
                require((child.page, child.slot) not in self.reached, place, rule("references"),
                        "group is the child of two nodes")
                require(below.level > group.level, place, rule("node-level"),
                        "level is not below the parent's")
                require(len(below.children) >= 2, place, rule("node-children"),
                        "group has one child and is not the root")
                first = last = below.cell
                if self.is_in_part(child):
                    self.take_group(child, at)
                else:
                    yield child.page, child.slot
            else:
                first, last = self.take_leaf(child, at, rule("node-leaf"))
            require(cell_of(first, group.level) == group.cell == cell_of(last, group.level), at,
                    rule("node-cell"), "child lies outside the cell")
            if group.level < 42 and len(group.children) > 1:
                shift = 3 * (41 - group.level)
                require(before < first >> shift == last >> shift, at, rule("node-children"),
                        "children are not in octants in order")
                before = last >> shift
        require(len(group.children) == 1 or self.next_point - start > s.leaf_points, at,
                "spec/nodes.md#node-leaf", "group splits points that are a leaf")
        self.runs[page, slot] = start, self.next_point

    def take_group(self, child, at):
        """Takes a part's group whole: what is below it was verified with the part."""
        part = self.c.part_of_node_page(child.page)
        record = self.c.records[part]
        self.reached.add((child.page, child.slot))
        start, end = self.parts[part].runs[child.page - record.first_node_page, child.slot]
        require(record.first_point + start == self.next_point, at, PARTS_TOP,
                "points of a part's group do not follow those before")
        self.next_point += end - start

    def take_leaf(self, child, at, clause):
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
