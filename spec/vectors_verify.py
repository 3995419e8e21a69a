"""Files whose fault a look at one page does not show, named like those of vectors_bad.py.

Readers may use them, as far as they check; a verifier refuses them.
"""

import reader as r
from vectors import Draft, encode_points
from vectors_good import changed, lamps, one_point
from vectors_tree import Surfel, scatter


def tree_of(surfels, change, leaf_points=1):
    """A file whose groups were changed before they were encoded."""
    draft = Draft(surfels, leaf_points=leaf_points)
    change(draft.tree.groups)
    first = draft.first_node
    last = len(draft.pages) - 1
    draft.pages[first:last] = [draft.node_page(draft.tree.groups)]
    return draft


def four_points():
    """Two pairs of points: a root with two groups of two leaves each."""
    far = 1 << 41
    return [Surfel((x + dx, 0, 0), radius=1) for x in (0, far) for dx in (0, 1 << 30)]


def verify_container():
    yield "container-padding", changed(
        one_point(), lambda d: d.patches.append((d.offset(0) + 64 + 34, b"\1")))
    yield "container-padding.directory", changed(
        one_point(), lambda d: d.patches.append((-8192 - 1, b"\1")))
    yield "container-page-keys", changed(
        one_point(), lambda d: setattr(d.pages[0], "keys", (0, d.pages[0].keys[1])))
    yield "container-page-keys.groups", changed(
        one_point(), lambda d: setattr(d.pages[1], "keys", (0, 1)))
    yield "container-page-level", changed(
        one_point(), lambda d: setattr(d.pages[1], "level", 1))
    yield "container-superblock-checksum", changed(
        one_point(), lambda d: d.patches.append((-4096 + 500, b"X")))
    yield "container-superblock-magic", changed(
        one_point(), lambda d: d.patches.append((-8192, b"X")))
    yield "container-superblock-totals", changed(
        one_point(), lambda d: d.super.update(area=0.126))
    yield "container-superblock-totals.flux", changed(
        one_point(), lambda d: d.super.update(flux=(0.125, 0.0625, 0.03126)))
    yield "container-superblock-totals.bounds", changed(
        one_point(), lambda d: d.super.update(bounds_low=(0.0, 0.0, 0.0)))
    yield "container-superblock-totals.empty", changed(
        Draft(), lambda d: d.super.update(bounds_low=(-1.0, 0.0, 0.0)))
    yield "container-superblock-counts", changed(
        one_point(), lambda d: d.super.update(nodes=2))
    yield "container-superblock-root", changed(
        one_point(), lambda d: d.super.update(levels=2))
    swapped = Draft(scatter(113, 9), leaf_points=200)
    surfels = swapped.surfels[:111] + swapped.surfels[112:] + swapped.surfels[111:112]
    for page, part in zip(swapped.pages, (surfels[:112], surfels[112:])):
        page.payload, page.keys = encode_points(part, 34), (part[0].key >> 63, part[-1].key >> 63)
    yield "points-point-order", swapped


def verify_tree():
    four = four_points()

    def level(groups):
        groups[0][1] = groups[-1][1] = groups[0][1] + 1
        groups[-1][0] = 0
        groups[-1][1] = 20
    def fan(groups):
        """Both children of each are the same: 2^24 ways lead to the last."""
        for group in groups[1:]:
            group[2][1] = group[2][0]
    yield "nodes-references", tree_of(four, lambda g: g[2][2].__setitem__(1, (True, 0)))

    def lost(groups):
        groups[2][2][1] = (False, (3, 2))

    def island(groups):
        lost(groups)
        groups[1][2][1] = (True, 1)
    five = four + [Surfel((0, 1 << 30, 0), radius=1)]
    for name, change in (("lost", lost), ("island", island)):
        yield f"nodes-references.{name}", changed(
            tree_of(five, change), lambda d: d.super.update(leaf_points=2))
    yield "nodes-references.itself", tree_of(four, lambda g: g[2][2].__setitem__(1, (True, 2)))
    yield "nodes-references.cycle", tree_of(four, lambda g: g[0][2].__setitem__(1, (True, 2)))
    yield "nodes-references.fan", tree_of([Surfel((0, 0, 0), radius=1)] + [
        Surfel((1 << k, 0, 0), radius=1) for k in range(17, 42)], fan)
    yield "nodes-node-level", tree_of(four, level)
    yield "nodes-node-cell", tree_of(four, lambda g: g[1].__setitem__(0, r.interleave(
        3 << 40, 0, 0)))
    yield "nodes-node-cell.point", tree_of(four, lambda g: g[0].__setitem__(1, 20))
    yield "nodes-node-children", tree_of(four, lambda g: (g[0][2].pop(), g[0][3].pop()))
    yield "nodes-node-children.octants", tree_of(
        four, lambda g: g[0].__setitem__(1, g[0][1] - 1))
    yield "nodes-node-leaf", tree_of(
        four, lambda g: g[0][2].__setitem__(slice(0, 2), [(False, (1, 1)), (False, (0, 1))]))
    yield "nodes-node-leaf.small-group", changed(
        tree_of(four, lambda g: None), lambda d: d.super.update(leaf_points=2))
    yield "nodes-node-leaf.great-leaf", changed(
        Draft(scatter(20, 4)), lambda d: d.super.update(leaf_points=1))


def verify_summaries():
    """reader.py does not recompute these."""
    def column(name, value):
        return tree_of(four_points(), lambda g: g[2][3][0].__setitem__(name, value))
    yield "nodes-node-mean", column("mean_x", 9)
    yield "nodes-node-sphere", column("radius", 0x4000)
    yield "nodes-node-slab", column("thickness", 0x9300)
    yield "nodes-node-sums", column("area", 0x3F80)
    yield "nodes-node-sums.facing", column("facing", [9] * 6)
    yield "nodes-node-sums.radiance", column("radiance", [0, 0, 0, 0, 0x80808080, 0])
    yield "nodes-node-cone", column("cone_cos", 0)
    yield "nodes-node-greatest", column("greatest", 0x4000)

    def glow(groups):
        groups[-1][3][0]["emission"] = [0] * 6
    yield "nodes-node-sums.emission", tree_like(lamps(), glow)


def tree_like(draft, change):
    """A file whose groups were changed, apart from their number and size."""
    change(draft.tree.groups)
    draft.pages[draft.first_node:-1] = [draft.node_page(batch) for batch in draft.batches]
    return draft


def draft_points(draft):
    return draft.pages[:draft.point_pages]


def dark_flux(draft):
    """The sums of the superblock when no point emits light."""
    return tuple(sum(p.area * p.radiance[c] for p in draft.surfels) for c in range(3))


def vectors():
    dark = lamps()
    for page in draft_points(dark):
        page.payload[34 * page.count:] = bytes(6 * page.count)
    dark.super.update(flux=dark_flux(dark))
    yield "nodes-node-emission", dark
    for source in (verify_container, verify_tree, verify_summaries):
        yield from source()
