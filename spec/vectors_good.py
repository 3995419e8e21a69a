"""Files that every reader accepts, each the smallest that shows what no other does."""

import shutil
import struct

import reader as r
from vectors import Draft, Page, channel, frame_of
from vectors_tree import FLOAT_MAX, Surfel, scatter

CHANNELS = (("irradiance", 3, 3, 1), ("occlusion", 1, 1, 1), ("part", 4, 1, 9))
COORDINATES = 1 << 42


def changed(draft, change):
    change(draft)
    return draft


def one_point():
    return Draft([Surfel((1 << 41, 3, COORDINATES - 1), (0, 1, 0), 0.25, (1, 0.5, 0.25),
                         (255, 128, 0))])


def zero_point():
    """A point whose columns are all zero, but that octahedral zero is +z."""
    return Draft([Surfel((0, 0, 0))])


def two_pages():
    """With a leaf across the two."""
    return Draft(scatter(130, 7))


def corners(distance, **columns):
    return [Surfel((x, y, z), **columns) for x in (0, distance) for y in (0, distance)
            for z in (0, distance)]


def lamps():
    """Points of which a few emit light, so that some groups have columns of emission."""
    surfels = scatter(130, 5)
    for s in surfels[::40]:
        s.own = (0x3C00, 0x4000, 1)  # 1, 2, the least half
        s.emission = tuple(map(r.half_to_float, s.own))
    return Draft(surfels, leaf_points=2, point_bytes=40)


# Pages -------------------------------------------------------------------------------------------

def nodes_by_any_rank():
    """Node pages of which the root's is the first, and the others descend."""
    draft = Draft(scatter(130, 5), leaf_points=1, channels=CHANNELS)
    draft.renumber(list(reversed(range(len(draft.batches)))))
    return draft


def tail_of(nodes):
    """All node pages but the last `nodes` ones before the directory."""
    return Draft(scatter(130, 5), leaf_points=1, channels=CHANNELS, tail_nodes=nodes)


def root_first():
    """Groups before their children, most of which are on later pages."""
    draft = two_pages()
    tree, last = draft.tree, len(draft.tree.groups) - 1
    for group in tree.groups:
        group[2] = [(i, last - where if i else where) for i, where in group[2]]
    tree.groups.reverse()
    tree.root = 0
    meta = draft.pages.pop()
    del draft.pages[draft.point_pages:]
    draft.add_nodes()
    draft.pages.append(meta)
    return draft


def full_directory_pages():
    """200 pages, 100 to each of two directory pages: three of points, two of nodes, 194 of attributes, and the meta
    page."""
    return Draft(scatter(225, 8), leaf_points=8, page_shift=12,
                 channels=[(f"c{k}", 1, 1, k) for k in range(1, 43)])


def max_leaf():
    """65535 points in one leaf, on full pages of the greatest size that take 136 bytes in the file."""
    draft = Draft([Surfel((5, 6, 7), radius=1, radiance=(1, 2, 3))] * 65535, leaf_points=65535,
                  page_shift=20)
    for page in draft.pages[:draft.point_pages]:
        draft.pack(page, r.POINT_COLUMNS, r.LZ4)
    return draft


# Codecs ------------------------------------------------------------------------------------------

ZEROS_XXH64 = bytes.fromhex("e020a050")  # of 34 zeros, the lower half: a zstd frame's checksum


def with_frame(content_size_bytes=1, checksum=b""):
    draft = zero_point()
    draft.pages[0].stored = frame_of(bytes(34), content_size_bytes, checksum)
    draft.pages[0].codec = r.ZSTD
    return draft


def frames_by_hand():
    """Content sizes of 8, 4 and 2 bytes, blocks as they are, and a checksum of the content."""
    draft = Draft([Surfel((0, 0, 0))], channels=[("a", 1, 16, 1)], text=[("a", 300 * "=")])
    for page, width, checksum in zip(draft.pages, (1, 4, 8, 2), (ZEROS_XXH64, b"", b"", b"")):
        page.stored, page.codec = frame_of(bytes(page.payload), width, checksum), r.ZSTD
    return draft


def rle_block():
    """34 zeros as an LZ4 block made by hand: a literal, a match that overlaps itself, 5 literals."""
    return struct.pack("<I", 34) + b"\x1f\0\1\0\x09\x50" + bytes(5)


def with_lz4():
    draft = zero_point()
    draft.pages[0].stored, draft.pages[0].codec = rle_block(), r.LZ4
    return draft


def with_zstd():
    draft = two_pages()
    for page in draft.pages:
        draft.compress(page)
    return draft


def slope(count=100):
    """Points whose numbers differ little from one to the next: what packs well."""
    return [Surfel((i << 30, i << 29, (1 << 41) + (i << 28)), radius=0.25, radiance=(i, 2 * i, 0.5),
                   albedo=(i, 2 * i, 255 - i)) for i in range(count)]


def columns_of(channels, group):
    return r.group_columns([channel(*c) for c in channels], group)


def packed(codec, loose=()):
    draft = Draft(slope(), channels=CHANNELS)
    for page in draft.pages:
        if page.type == r.POINT:
            draft.pack(page, r.POINT_COLUMNS, codec, loose)
        if page.type == r.ATTRIBUTE and page.group == 1:
            draft.pack(page, columns_of(CHANNELS, 1), r.LZ4)
    return draft


def max_shifts():
    """Numbers of which the top bit alone differs: shifts of 41, 15 and 7."""
    surfels = [Surfel(q.q, radius=2.0 * (i & 1), radiance=(0, 2.0 * (i & 1), 0),
                      albedo=(0, 128 * (i & 1), 0), uv=(-32768 * (i & 1), 0))
               for i, q in enumerate(corners(1 << 41))]
    draft = Draft(surfels)
    draft.pack(draft.pages[0], r.POINT_COLUMNS, r.LZ4)
    return draft


# Attributes and texts ----------------------------------------------------------------------------

ALL_TYPES = (("a", 1, 16, 1), ("b.c_9", 2, 1, 1), ("z" * 31, 4, 4, 1), ("half", 3, 16, 2),
             ("word", 2, 16, 3), ("last", 3, 1, 3), ("u32", 5, 3, 4), ("u64", 6, 2, 4), ("i8", 7, 3, 5),
             ("i16", 8, 3, 5), ("i32", 9, 2, 5), ("i64", 10, 2, 6), ("f64", 11, 2, 6), ("float", 4, 8, 255))
VALUES = {1: (0, 255, 128, 1), 2: (0, 65535, 256, 1), 3: (0, 0x8000, 1, 0x7BFF, 0x7C00, 0xFE00),
          4: (0, 1 << 31, 1, 0x7F7FFFFF, 0x7F800000, 0xFFFFFFFF), 5: (0, (1 << 32) - 1, 1 << 31, 1),
          6: (0, (1 << 64) - 1, 1 << 63, 1), 7: (0, 255, 128, 1), 8: (0, 65535, 1 << 15, 1),
          9: (0, (1 << 32) - 1, 1 << 31, 1), 10: (0, (1 << 64) - 1, 1 << 63, 1),
          11: (0, 1 << 63, 1, 0x7FEFFFFFFFFFFFFF, 0x7FF0000000000000, (1 << 64) - 1)}
FORMS = {1: "B", 2: "H", 4: "I", 8: "Q"}


def channels_of_every_type():
    """The widest groups, columns that are not aligned, numbers at the ends of their ranges, infinities and NaN."""
    draft = Draft(slope(101), channels=ALL_TYPES)
    for page in draft.pages:
        if page.type != r.ATTRIBUTE:
            continue
        page.payload = bytearray()
        for _, type_, components, group in ALL_TYPES:
            values = VALUES[type_]
            for c in range(components if group == page.group else 0):
                step = 0 if c < components // 2 else 1
                page.payload += struct.pack(f"<{page.count}{FORMS[r.CHANNEL_BYTES[type_]]}", *(
                    values[(c + step * i) % len(values)] for i in range(page.count)))
        if page.group > 1:
            draft.pack(page, columns_of(ALL_TYPES, page.group), r.LZ4 if page.group < 3 else r.ZSTD)
    return draft


def schema():
    """Every role and colour space, units, scales, offsets, values that stand for none, and types of a later version."""
    return (channel("albedo.srgb", 1, 3, 1, role=1, colour_space=2, unit="1"),
            channel("normal", 8, 3, 1, role=2, scale=1 / 32767),
            channel("speed", 4, 3, 1, role=3, unit="m/s"),
            channel("class", 1, 1, 2, role=4, no_value=0),
            channel("original_index", 6, 1, 2, role=5),
            channel("gps_time", 11, 1, 2, role=6, unit="s", offset=1e9),
            channel("height", 9, 1, 2, unit="m", scale=0.001, offset=-7.5, no_value=1 << 31),
            channel("later", 200, 1, 3, role=77, colour_space=99, size=8, no_value=(1 << 64) - 1))


def void_pages():
    """Of three point pages, the channels of the second are not known at all; of a group, none on any page."""
    draft = Draft(scatter(225, 6), channels=schema())
    for page in draft.pages:
        if page.type == r.ATTRIBUTE:
            page.void = page.group == 3 or page is draft.pages[4]
            if page.void:
                entry = r.Entry(0, 0, 0, 0, 0, page.count, page.type, page.group, page.level)
                page.payload = bytearray(r.void_payload(draft.channels, entry))
    return draft


def facts():
    """The texts whose form is fixed."""
    return Draft(text=[("crs", "EPSG:25832"), ("metres_per_unit", "3.048e-1"), ("time", "-12.5"),
                       ("up", "z")])


def later_pages():
    """What a later 1.x may add: skippable pages, unknown bits of feature_compat, a type, roles and texts."""
    draft = Draft(scatter(130, 5), channels=schema(), text=[("later.key", "of 1.1")])
    draft.head.update(minor=1, compat=5)
    draft.pages[-1:-1] = [Page(128, b"later", 9), Page(128, b"more", 1), Page(255, bytes(100), 3)]
    return draft


def texts():
    """UTF-8 of every length and at its limits; control characters; the longest writer's name."""
    draft = Draft(text=[
        ("a", ""),
        ("k" * 31, "\x7f\x80\u07ff\u0800\ud7ff\ue000\uffff\U00010000\U0010ffff"),
        ("rounding", "\x01\t\r\n\x1b[31m\x7f\x9b\u2028\u202e\ufeff\\\"")])
    draft.super["writer"] = "caf\u00e9 \x1b[2J".encode().ljust(59, b"x") + "\U0001d11e".encode()
    return draft


# Numbers -----------------------------------------------------------------------------------------

def every_fold():
    """Octahedral numbers at the corners, edges and middle of the square, -32768 among them."""
    ends = (-32768, -32767, 0, 32767)
    return [Surfel((i << 30, 0, 0), radius=1, radiance=(1, 1, 1), uv=(u, v))
            for i, (u, v) in enumerate((u, v) for u in ends for v in ends)]


def scaled(surfels, **columns):
    return [Surfel(s.q, s.normal, **columns) for s in surfels]


def vectors():
    top = COORDINATES - 1
    coincident = [Surfel((5, 6, 7), radius=0.5, radiance=(1, 1, 1))]
    yield "empty", Draft()
    yield "empty-with-channels", Draft(channels=CHANNELS)
    yield "empty-without-limits", Draft(leaf_points=0)
    yield "one-point", one_point()
    yield "corners-of-the-lattice", Draft(corners(top, radius=1), leaf_points=1)
    yield "chain-of-42-levels", Draft([Surfel((0, 0, 0), radius=1)] + [
        Surfel((1 << k, 0, 0), radius=1) for k in range(42)], leaf_points=1)
    yield "three-coincident-points", Draft(coincident * 3, leaf_points=1)
    yield "coincident-points-on-three-levels", Draft(coincident * 70, leaf_points=1)
    yield "greatest-leaf", max_leaf()
    yield "two-pages", two_pages()
    yield "root-first", root_first()
    yield "pages-in-any-place", changed(two_pages(), lambda d: setattr(d, "lie", reversed))
    yield "nodes-by-any-rank", nodes_by_any_rank()
    yield "tail-of-one-page", tail_of(0)
    yield "tail-of-two-pages", tail_of(1)
    yield "emission", lamps()
    yield "schema", Draft(scatter(20, 5), channels=schema())
    yield "void-pages", void_pages()
    yield "facts", facts()
    yield "pages-of-a-later-version", later_pages()
    yield "page-shift-20", Draft(scatter(20, 4), page_shift=20)
    yield "directory-pages-full", full_directory_pages()
    yield "attributes", Draft(scatter(130, 5), channels=CHANNELS,
                              text=(("scene", "caf\u00e9"), ("unit", "m")))
    yield "channels-of-every-type", channels_of_every_type()
    yield "texts", texts()
    yield "far-origin", Draft(scatter(20, 3), origin=(1e7, -1e7, 0.0))
    yield "least-frame", Draft(scaled(scatter(20, 3)), edge=2.0 ** -960,
                               origin=(3 * 2.0 ** -1002, -5 * 2.0 ** -1002, 0.0))
    yield "greatest-frame", Draft(scatter(20, 3), edge=2.0 ** 1010, origin=(
        -2.0 ** 53 * 2.0 ** 968, (2.0 ** 53 - 2.0 ** 42) * 2.0 ** 968, 0.0))
    yield "every-fold", Draft(every_fold())
    yield "least-numbers", Draft(scaled(scatter(10, 3), radius=0, radiance=(65504, 0, 1))
                                 + scaled(scatter(10, 4), radius=2 ** -149, radiance=(2 ** -24, 0, 0)))
    yield "greatest-numbers", Draft(scaled(scatter(20, 3), radius=FLOAT_MAX, radiance=3 * (65504,),
                                           albedo=3 * (255,)))
    yield "unknown-compatible-features", changed(one_point(), lambda d: d.head.update(
        compat=(1 << 64) - 1))
    yield "unknown-read-only-features", changed(one_point(), lambda d: d.head.update(
        ro_compat=(1 << 64) - 1))
    yield "newer-minor-version", changed(one_point(), lambda d: d.head.update(minor=65535))
    yield "zstd-frame-by-hand", with_frame()
    yield "zstd-frames-of-every-kind", frames_by_hand()
    yield "lz4-block-by-hand", with_lz4()
    yield "packed-columns-zstd", packed(r.ZSTD)
    yield "packed-columns-lz4", packed(r.LZ4)
    yield "packed-columns-loose", packed(r.LZ4, loose=(8, 16, 42))
    yield "packed-columns-greatest-shifts", max_shifts()
    if shutil.which("zstd"):
        yield "zstd", with_zstd()
