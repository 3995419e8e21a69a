"""Files that readers refuse: for each rule the smallest that breaks it and no other.

A name is document-anchor of the rule, with .variant where it is broken in several ways. All
checksums are right but those that the rule is about.
"""

import struct

import reader as r
from vectors import (UUID, Draft, Page, channel, encode_meta, frame_of, literal_block,
                     pack_columns)
from vectors_good import (CHANNELS, changed, later_pages, one_point, packed, rle_block, void_pages,
                          zero_point)
from vectors_tree import Surfel, scatter

NAN = float("nan")


# container.md ------------------------------------------------------------------------------------

def bad_header():
    def head(**fields):
        return changed(Draft(), lambda d: d.head.update(fields))

    def patch(at, new):
        return changed(Draft(), lambda d: d.patches.append((at, new)))
    yield "container-header-magic", patch(0, b"\x09")
    yield "container-header-length", Draft().to_bytes()[:100]
    yield "container-header-checksum", patch(44, b"\xff")
    yield "container-header-version", head(major=2)
    yield "container-header-features", head(incompat=r.RELEASE | 1 << 5)
    yield "container-header-features.before-constants", head(incompat=r.RELEASE | 1 << 5, align_shift=13)
    yield "container-header-draft", head(incompat=0)
    yield "container-header-point-bytes", head(point_bytes=36)
    yield "container-header-constants", head(align_shift=13)
    yield "container-header-constants.byte-order", head(byte_order=0x04030201)
    yield "container-header-page-shift", Draft(page_shift=11)
    yield "container-header-page-shift.above", Draft(page_shift=21)
    yield "container-header-page-shift.greatest", head(page_shift=255)
    frame = "container-header-frame"
    yield frame, head(edge=3.0)
    yield frame + ".negative", head(edge=-4.0)
    yield frame + ".zero", head(edge=0.0)
    yield frame + ".nan", head(edge=NAN)
    yield frame + ".far-below", head(origin=(-2.0 ** 33 - 1, 0.0, 0.0))
    yield frame + ".origin", head(origin=(2.0 ** -21, 0.0, 0.0))
    yield frame + ".far", head(origin=(0.0, 2.0 ** 34, 0.0))
    yield "container-header-zero", head(reserved=b"\1" + bytes(22))
    yield "container-header-zero.rest", patch(4095, b"\1")


def bad_page():
    def page(number=0, both=None, **header):
        draft = one_point()
        draft.pages[number].header.update(header)
        draft.pages[number].header.update(both or {})
        draft.pages[number].entry.update(both or {})
        return draft
    nothing = {"offset": 0, "stored_bytes": 0, "raw_bytes": 0, "payload_xxh3": 0}
    other = one_point()
    other.pages[0].uuid = UUID[::-1]
    fields = one_point()
    fields.pages[0].level = 0
    yield "container-page-magic", changed(
        one_point(), lambda d: d.patches.append((d.offset(0), b"X")))
    yield "container-page-checksum", changed(
        one_point(), lambda d: d.patches.append((d.offset(0) + 32, b"X")))
    yield "container-page-checksum.other-file", other
    yield "container-page-type", page(both={"type": 7})
    yield "container-page-type.zero", page(both={"type": 0})
    yield "container-page-type.void", changed(one_point(), lambda d: d.pages[0].entry.update(nothing, type=7))
    yield "container-page-codec", page(codec=3)
    yield "container-page-codec.directory", changed(
        one_point(), lambda d: d.directory.update(codec=1, stored_bytes=119))
    yield "container-page-filter", changed(packed(r.LZ4), lambda d: d.pages[0].header.update(filter=2))
    yield "container-page-filter.raw", page(filter=1)
    nodes = packed(r.LZ4)
    node = nodes.pages[nodes.first_node]
    node.stored, node.codec, node.filter = rle_block(), r.LZ4, r.PACKED
    yield "container-page-filter.nodes", nodes
    yield "container-page-length", page(both={"raw_bytes": 33})
    yield "container-page-length.above", page(both={"raw_bytes": 0xFFFFFFFF})
    yield "container-page-length.zero", page(both={"raw_bytes": 0, "stored_bytes": 0})
    yield "container-page-length.raw", page(codec=2)
    yield "container-page-length.void-point", changed(one_point(), lambda d: d.pages[0].entry.update(nothing))
    yield "container-page-length.void-later", changed(later_pages(), lambda d: d.pages[-2].entry.update(nothing))
    yield "container-page-length.void-with-offset", changed(
        void_pages(), lambda d: d.pages[4].entry.update(offset=4096))
    yield "container-page-length.void-with-hash", changed(
        void_pages(), lambda d: d.pages[4].entry.update(payload_xxh3=1))
    yield "container-page-fields", page(both={"group": 1})
    yield "container-page-fields.count", page(both={"record_count": 2})
    yield "container-page-fields.no-records", page(both={"record_count": 0})
    yield "container-page-fields.wraps", page(both={"record_count": (1 << 31) + 1})
    yield "container-page-fields.reserved", page(reserved=b"\1" + bytes(6))
    yield "container-page-fields.entry", changed(one_point(), lambda d: d.pages[0].entry.update(zero=1))
    yield "container-page-fields.level", fields
    yield "container-page-keys", page(first_key=1 << 62, last_key=1)
    yield "container-page-keys.bit-63", page(last_key=1 << 63)
    yield "container-page-agreement", page(rank=1)
    yield "container-page-agreement.length", changed(
        one_point(), lambda d: d.pages[1].entry.update(raw_bytes=104, stored_bytes=104))
    yield "container-page-agreement.group-count", page(1, record_count=2)
    yield "container-page-payload", changed(
        one_point(), lambda d: d.patches.append((d.offset(0) + 64 + 30, b"X")))


def bad_codec():
    def stored(frame):
        draft = zero_point()
        draft.pages[0].stored, draft.pages[0].codec = frame, r.ZSTD
        return draft
    frame = frame_of(bytes(34))
    yield "container-codec-frame", stored(frame_of(bytes(33)))
    yield "container-codec-frame.longer", stored(frame_of(bytes(35)))
    yield "container-codec-frame.greatest", stored(b"\x28\xb5\x2f\xfd\xe0" + b"\xff" * 8 + frame[6:])
    yield "container-codec-frame.short-content", stored(frame[:6] + frame_of(bytes(33))[6:])
    yield "container-codec-frame.long-content", stored(frame[:6] + frame_of(bytes(35))[6:])
    yield "container-codec-frame.checksum", stored(frame_of(bytes(34), 1, b"\1\2\3\4"))
    yield "container-codec-frame.trailing", stored(frame + b"\0")
    yield "container-codec-frame.truncated", stored(frame[:-1])
    yield "container-codec-frame.window", stored(frame[:4] + b"\0\x58" + frame[6:])
    yield "container-codec-frame.dictionary", stored(frame[:4] + b"\x21\x01" + frame[5:])
    yield "container-codec-frame.no-frame", stored(b"\0" * 10)

    def block(bytes_):
        draft = zero_point()
        draft.pages[0].stored, draft.pages[0].codec = bytes_, r.LZ4
        return draft
    good_block = rle_block()
    clause = "container-codec-block"
    yield clause, block(struct.pack("<I", 33) + good_block[4:])
    yield clause + ".longer", block(struct.pack("<I", 35) + good_block[4:])
    yield clause + ".greatest", block(b"\xff" * 4 + good_block[4:])
    yield clause + ".short-content", block(good_block[:8] + b"\x08" + good_block[9:])
    yield clause + ".literals", block(good_block[:4] + b"\xf0\xff" + good_block[6:])
    yield clause + ".last-literals", block(good_block[:8] + b"\x0a\x40" + bytes(4))
    yield clause + ".short", block(good_block[:4])
    yield clause + ".trailing", block(good_block + b"\0")
    yield clause + ".truncated", block(good_block[:-1])
    yield clause + ".match-before-start", block(good_block[:6] + b"\2" + good_block[7:])
    yield clause + ".match-too-long", block(good_block[:8] + b"\xff\xff\xff\xff\0" + good_block[9:])


def bad_packed():
    """Packed columns of the first point page."""
    def change(edit):
        draft = packed(r.LZ4)
        page = draft.pages[0]
        content = bytearray(pack_columns(bytes(page.payload), r.POINT_COLUMNS, page.count))
        edit(content)
        page.stored = literal_block(bytes(content))
        return draft
    clause = "points-packed-columns"
    yield clause, change(lambda c: c.__setitem__(0, 42))
    yield clause + ".planes", change(lambda c: c.__setitem__(1, 7))
    yield clause + ".base", change(lambda c: c.__setitem__(9, 1))
    yield clause + ".plane", change(lambda c: c.__delitem__(slice(-11, None)))
    yield clause + ".trailing", change(lambda c: c.append(0))
    yield clause + ".head", change(lambda c: c.__delitem__(slice(-9, None)))


def directory_at():
    return r.round_up(one_point().offset(0) + r.SECTOR, r.BLOCK)


def bad_directory():
    def entry(**fields):
        return changed(one_point(), lambda d: d.pages[0].entry.update(fields))
    extent = "container-directory-extent"
    yield extent, entry(offset=r.BLOCK + 64)
    yield extent + ".header", entry(offset=0)
    yield extent + ".superblock", entry(offset=directory_at() + 2 * r.BLOCK)
    yield extent + ".wraps", entry(offset=(1 << 64) - r.BLOCK)
    yield extent + ".end-wraps", entry(offset=(1 << 64) - r.SECTOR)
    yield "container-directory-listing", entry(type=r.DIRECTORY, raw_bytes=40, stored_bytes=40)
    yield "container-directory-listing.type", entry(type=r.META, first_key=0)
    groups = Draft(scatter(10, 5), channels=CHANNELS)
    groups.pages[1:3] = groups.pages[2:0:-1]
    yield "container-directory-listing.group", groups
    for name, page in (("parts", Page(r.PARTS, bytes(384), 1)), ("two-meta", Page(r.META, encode_meta(), 1))):
        draft = one_point()
        draft.pages.insert(2, page)
        yield f"container-directory-listing.{name}", draft
    yield "container-directory-overlap", entry(offset=one_point().offset(1))
    yield "container-directory-overlap.directory", entry(offset=directory_at())
    yield "container-directory-pages", changed(one_point(), lambda d: d.directory.update(rank=9))
    yield "container-directory-pages.fewer", changed(one_point(), lambda d: d.directory.update(
        record_count=2, raw_bytes=80, stored_bytes=80))
    yield "container-directory-pages.checksum", changed(
        one_point(), lambda d: d.super.update(directory_xxh3=1))


def bad_superblock():
    def with_(**fields):
        return changed(one_point(), lambda d: d.super.update(fields))
    good_identity = one_point().identity()
    yield "container-superblock-magic", one_point().to_bytes()[:-8192]
    yield "container-superblock-magic.truncated", one_point().to_bytes()[:8192]
    yield "container-superblock-checksum", changed(
        Draft(), lambda d: d.patches.extend([(-8192 + 500, b"X"), (-4096 + 500, b"X")]))
    yield "container-superblock-header", with_(identity=good_identity[:40] + b"X"
                                               + good_identity[41:])
    yield "container-superblock-length", with_(file_bytes=1 << 20)
    yield "container-superblock-length.appended", one_point().to_bytes() + bytes(4096)
    yield "container-superblock-length.three-bytes", one_point().to_bytes() + b"\r\n\x1a"
    yield "container-superblock-length.half", one_point().to_bytes()[:-4096]
    yield "container-superblock-copies", changed(
        one_point(), lambda d: d.super_b.update(area=1.0))
    yield "container-superblock-copies.rule", changed(
        one_point(), lambda d: d.super_b.update(reserved=1))
    pages = "container-superblock-pages"
    yield pages, with_(point_pages=3)
    yield pages + ".none", with_(page_count=0, directory_pages=0)
    yield pages + ".directory", with_(directory_offset=4096)
    yield pages + ".directory-pages", with_(directory_pages=2)
    many = {"page_count": r.NO_PAGE - 1, "directory_pages": (r.NO_PAGE - 2) // 100 + 1}
    yield pages + ".greatest", with_(**many)
    bytes_ = r.directory_bytes(r.Header(b"", 1, 0, r.RELEASE, UUID, 12, (0.0,) * 3, 1.0, 34), r.NO_PAGE - 1)
    yield pages + ".wraps", with_(**many, directory_offset=directory_at() + r.BLOCK - bytes_
                                  & (1 << 64) - 1)
    tail = "container-tail-pages"
    entries = r.unpack_superblock(one_point().to_bytes()[-r.BLOCK:]).tail
    yield tail, with_(tail_pages=0)
    yield tail + ".above", with_(tail_pages=65)
    yield tail + ".fewer", with_(tail_pages=1)
    yield tail + ".other-entry", with_(tail=entries[:16] + b"X" + entries[17:])
    yield tail + ".other-place", with_(tail=entries[:1] + bytes([entries[1] + 2]) + entries[2:])
    yield tail + ".behind", with_(tail=entries[:80] + b"X" + entries[81:])
    root = "container-superblock-root"
    yield root, with_(root_page=r.NO_PAGE)
    yield root + ".beyond", with_(root_page=1)
    yield root + ".slot", with_(root_slot=1)
    yield root + ".levels", with_(levels=64)
    counts = "container-superblock-counts"
    yield counts, with_(points=2)
    yield counts + ".groups", with_(node_groups=2, nodes=2)
    yield counts + ".nodes", with_(nodes=9)
    yield counts + ".above", with_(points=(1 << 48) + 1)
    yield counts + ".groups-above", with_(node_groups=1 << 61, nodes=1 << 48)
    yield counts + ".leaf-points", with_(leaf_points=0)
    yield counts + ".attribute-groups", changed(Draft(), lambda d: d.super.update(attribute_groups=256))
    totals = "container-superblock-totals"
    yield totals, with_(area=NAN)
    yield totals + ".flux", with_(flux=(0.0, -1.0, 0.0))
    yield totals + ".bounds", with_(bounds_low=(0.0, 1.0, 0.0), bounds_high=(0.0, 0.5, 0.0))
    yield "container-superblock-digest", with_(content_xxh3=(1, 2))
    yield "container-superblock-writer", with_(writer=b"\xff")
    yield "container-superblock-writer.truncated", with_(writer=b"x" * 62 + b"\xc3")
    yield "container-superblock-writer.unended", with_(writer=b"x" * 64)
    yield "container-superblock-zero", with_(rest=b"\1" + bytes(1015))
    yield "container-superblock-zero.field", with_(reserved=1)
    yield "container-superblock-zero.middle", with_(middle=b"\1" + bytes(21))
    yield "container-superblock-zero.after-writer", with_(after_writer=b"\1" + bytes(119))
    yield "container-meta-page", changed(one_point(), lambda d: d.pages[2].entry.update(type=128))


# points.md ---------------------------------------------------------------------------------------

def bad_points():
    def payload(at, new, draft=None):
        draft = draft or one_point()
        draft.pages[0].payload[at:at + len(new)] = new
        return draft
    pair = Draft([Surfel((1, 1, 1)), Surfel((2, 1, 1))])
    pair.pages[0].payload[:8] = pair.pages[0].payload[4:8] + pair.pages[0].payload[:4]
    yield "points-point-lattice", payload(15, b"\x40")
    yield "points-point-order", pair
    yield "points-point-order.high", payload(26, b"\x20", Draft([Surfel((1, 1, 1)),
                                                                Surfel((2, 1, 1 << 32))]))
    yield "points-point-radius", payload(16, struct.pack("<f", NAN))
    yield "points-point-radius.negative", payload(16, struct.pack("<f", -0.0))
    yield "points-point-radiance", payload(24, b"\x00\x7c")
    yield "points-point-radiance.negative", payload(28, b"\x00\xbc")
    yield "points-point-radiance.emission", payload(34, b"\x00\x7c", Draft([Surfel((1, 1, 1))], point_bytes=40))
    yield "points-point-flags", payload(33, b"\1")
    short = Draft(scatter(130, 7))
    first, second = short.pages[0], short.pages[1]
    short.pages[0], short.pages[1] = second, first
    yield "points-point-pages", short


def bad_meta():
    def meta(payload):
        draft = Draft()
        draft.pages[-1] = Page(r.META, payload, 1)
        return draft

    def with_channel(*fields, **others):
        return meta(encode_meta([channel(*fields, **others)]))
    size = "points-meta-size"
    yield size, meta(encode_meta() + b"\0")
    yield size + ".short", meta(bytes(4))
    yield size + ".channels", meta(struct.pack("<II", 0xFFFFFFFF, 0))
    yield size + ".channels-wrap", meta(struct.pack("<II", 1 << 29, 0))  # 88 * 2^29 is 11 * 2^32
    yield size + ".text-wraps", meta(struct.pack("<IIII", 0, 1, 2, 0xFFFFFFFF) + b"a")
    yield size + ".one-channel-more", meta(struct.pack("<II", 2, 0) + encode_meta([channel("a", 3, 1, 1)])[8:])
    yield size + ".texts", meta(struct.pack("<II", 0, 0xFFFFFFFF))
    yield size + ".text", meta(struct.pack("<IIII", 0, 1, 0xFFFFFFFF, 0xFFFFFFFF))
    yield "points-meta-channel", with_channel("Upper", 3, 1, 1)
    yield "points-meta-channel.controls", with_channel("\x1b[31m", 3, 1, 1)
    yield "points-meta-channel.unended", with_channel("a" * 32, 3, 1, 1)
    yield "points-meta-channel.size", with_channel("a", 4, 1, 1, size=2)
    yield "points-meta-channel.size-three", with_channel("a", 200, 1, 1, size=3)
    yield "points-meta-channel.role", with_channel("a", 4, 2, 1, role=2)
    yield "points-meta-channel.index", with_channel("a", 4, 1, 1, role=5)
    yield "points-meta-channel.scale", with_channel("a", 4, 1, 1, scale=0.0)
    yield "points-meta-channel.offset", with_channel("a", 4, 1, 1, offset=NAN)
    yield "points-meta-channel.no-value", with_channel("a", 1, 1, 1, no_value=256)
    broken = bytearray(encode_meta([channel("a", 1, 1, 1)]))
    broken[8 + 40] = 0xFF
    yield "points-meta-channel.unit", meta(broken)
    yield "points-meta-channel.components", with_channel("a", 3, 0, 1)
    yield "points-meta-channel.group", with_channel("a", 3, 1, 0)
    yield "points-meta-channel.width", with_channel("a", 4, 9, 1)
    yield "points-meta-channel.twice", meta(encode_meta([channel("a", 3, 1, 1), channel("a", 3, 1, 2)]))
    yield "points-meta-channel.order", meta(encode_meta([channel("a", 3, 1, 2), channel("b", 3, 1, 1)]))
    text = "points-meta-text"
    yield text, meta(struct.pack("<IIII", 0, 1, 1, 1) + b"a\xff")
    for name, value in (("truncated", b"\xf0\x9d\x84"), ("overlong", b"\xc0\x80")):
        yield f"{text}.{name}", meta(struct.pack("<IIII", 0, 1, 1, len(value)) + b"a" + value)
    yield text + ".key", meta(encode_meta((), [("A", "")]))
    yield text + ".nul", meta(encode_meta((), [("a", "\0")]))
    yield text + ".order", meta(encode_meta((), [("b", ""), ("a", "")]))
    for key, value in (("up", "w"), ("metres_per_unit", "-1"), ("time", "now")):
        yield f"points-meta-fact.{key}", meta(encode_meta((), [(key, value)]))
    for name, at in (("points-meta-zero", 31), ("points-meta-zero.field", 39), ("points-meta-zero.unit", 55),
                     ("points-meta-zero.flag", 37), ("points-meta-zero.no-value", 56),
                     ("points-meta-zero.end", 80)):
        padded = bytearray(encode_meta([channel("a", 3, 1, 1)]))
        padded[8 + at] = 2
        yield name, meta(padded)


def bad_attributes():
    clause = "points-attribute-pages"
    fewer = Draft(scatter(10, 5), channels=CHANNELS)
    fewer.pages[-1] = Page(r.META, encode_meta([channel(*CHANNELS[0])]), 1)
    other = Draft(scatter(10, 5), channels=CHANNELS)
    other.pages[2].group = 8
    short = Draft(scatter(10, 5), channels=CHANNELS)
    del short.pages[2].payload[-1]
    count = Draft(scatter(10, 5), channels=CHANNELS)
    count.pages[2].count = 9
    yield clause, fewer
    yield clause + ".unknown-group", other
    yield clause + ".bytes", short
    yield clause + ".count", count


# nodes.md ----------------------------------------------------------------------------------------

def bad_nodes():
    """The node page of one point: a slot table of 8 bytes, then a group with one child."""
    def payload(at, new):
        draft = one_point()
        draft.pages[1].payload[at:at + len(new)] = new
        return draft

    def reference(word, mask=b"\0"):
        return changed(payload(8 + 24, struct.pack("<Q", word)),
                       lambda d: d.pages[1].payload.__setitem__(slice(26, 27), mask))
    slots = "nodes-node-slots"
    yield slots, payload(0, b"\2")
    yield slots + ".children", payload(8 + 17, b"\2")
    yield slots + ".left-over", changed(one_point(), lambda d: d.pages[1].payload.extend(bytes(8)))
    yield slots + ".table", changed(one_point(), lambda d: (
        setattr(d.pages[1], "payload", d.pages[1].payload[:4])))
    yield "nodes-node-children", payload(8 + 17, b"\0")
    yield "nodes-node-children.nine", payload(8 + 17, b"\x09")
    yield "nodes-node-level", payload(8 + 16, b"\x3f")
    yield "nodes-node-cell", payload(8, struct.pack("<Q", 1))
    yield "nodes-node-cell.bit-63", payload(8 + 8, struct.pack("<Q", 1 << 63))
    yield "nodes-node-mask", payload(8 + 18, b"\2")
    yield "nodes-node-mask.flag", payload(8 + 19, b"\2")
    yield "nodes-node-mask.emission", payload(8 + 19, b"\1")
    yield "nodes-node-reference", reference(3, b"\1")
    yield "nodes-references", reference(1 << 32, b"\1")
    yield "nodes-node-leaf", reference(0)
    yield "nodes-node-leaf.past-the-end", reference(1 | 1 << 48)
    yield "nodes-node-leaf.two", reference(2 << 48)
    yield "nodes-node-leaf.wraps", reference((1 << 64) - 1)
    yield "nodes-node-number", payload(8 + 32 + 6, b"\x00\xff")
    yield "nodes-node-number.area", payload(8 + 32 + 12, b"\xff\xff")
    yield "nodes-node-number.thickness", payload(8 + 32 + 14, b"\0\xff")
    yield "nodes-node-number.greatest", payload(8 + 32 + 16, b"\0\xff")
    zero = "nodes-node-zero"
    yield zero, payload(8 + 20, b"\1")
    yield zero + ".padding", payload(8 + 86, b"\1")
    yield zero + ".table", payload(2, b"\1")
    yield zero + ".reference", reference(1 << 48, b"\1")


def vectors():
    for source in (bad_header, bad_page, bad_codec, bad_packed, bad_directory, bad_superblock,
                   bad_points, bad_meta, bad_attributes, bad_nodes):
        yield from source()
