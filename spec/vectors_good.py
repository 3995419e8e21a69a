"""Files that every reader accepts, each the smallest that shows what no other does."""

import shutil
import struct

import reader as r
from vectors import Draft, frame_of
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


# Pages -------------------------------------------------------------------------------------------

def pages_by_any_number():
    """Attributes, meta page, points and nodes, by their numbers."""
    draft = Draft(scatter(130, 5), channels=CHANNELS)
    draft.renumber(sorted(range(len(draft.pages)), key=lambda i: -draft.pages[i].type))
    return draft


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
    """252 pages, 126 to each of two directory pages: three of points, two of nodes, 246 of attributes."""
    return Draft(scatter(225, 8), leaf_points=8,
                 channels=[(f"c{k}", 1, 1, k) for k in range(1, 83)])


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
    for page, width, checksum in zip(draft.pages, (1, 8, 4, 2), (ZEROS_XXH64, b"", b"", b"")):
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
    return r.group_columns([r.Channel(*c) for c in channels], group)


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
             ("word", 2, 16, 3), ("last", 3, 1, 3), ("float", 4, 8, 255))
VALUES = {1: ("B", (0, 255, 128, 1)), 2: ("H", (0, 65535, 256, 1)),
          3: ("H", (0, 0x8000, 1, 0x7BFF, 0xFBFF, 0x3C00)),
          4: ("I", (0, 1 << 31, 1, 0x7F7FFFFF, 0xFF7FFFFF, 0x3F800000))}


def channels_of_every_type():
    """The widest groups, columns that are not aligned, numbers at the ends of their ranges."""
    draft = Draft(slope(101), channels=ALL_TYPES)
    for page in draft.pages:
        if page.type != r.ATTRIBUTE:
            continue
        page.payload = bytearray()
        for _, type_, components, group in ALL_TYPES:
            form, values = VALUES[type_]
            for c in range(components if group == page.group else 0):
                step = 0 if c < components // 2 else 1
                page.payload += struct.pack(f"<{page.count}{form}", *(
                    values[(c + step * i) % len(values)] for i in range(page.count)))
        if page.group > 1:
            draft.pack(page, columns_of(ALL_TYPES, page.group), r.LZ4 if page.group < 3 else r.ZSTD)
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
    yield "empty-without-limits", changed(Draft(leaf_points=0),
                                          lambda d: d.super.update(points_per_page=0))
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
    yield "pages-by-any-number", pages_by_any_number()
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
