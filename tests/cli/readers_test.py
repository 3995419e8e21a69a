"""Two readers that share no code, on files with one changed number and correct checksums.

They agree on whether a file is valid, and the rule by which one refuses it is among those that the other finds broken.
The changes are the same each time.
"""

import json
import random
import struct
import sys
import unittest
from pathlib import Path

from programs import ProgramTest, run

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "spec"))
import reader
import vectors_good as good
import verifier
from vectors import Draft
from vectors_tree import Surfel, scatter
from vectors_verify import four_points

DRAFTS = (
    good.one_point, good.two_pages, good.root_first, good.nodes_by_any_rank, good.texts, good.max_shifts,
    good.lamps, good.void_pages, good.facts, good.later_pages, lambda: good.tail_of(0), lambda: good.tail_of(1),
    lambda: Draft(scatter(20, 5), channels=good.schema()), good.with_lz4, good.frames_by_hand, lambda: good.packed(reader.LZ4), lambda: good.packed(reader.ZSTD),
    lambda: Draft(scatter(20, 5), channels=good.CHANNELS, text=(("a", "b"),)),
    lambda: Draft([Surfel((5, 6, 7), radius=0.5)] * 20, leaf_points=1),
    lambda: Draft(four_points(), leaf_points=1))
HEADER = {"type": 8, "codec": 8, "filter": 8, "rank": 32, "stored_bytes": 32, "raw_bytes": 32, "group": 8,
          "level": 8, "record_count": 32, "first_key": 64, "last_key": 64, "payload_xxh3": 64}
ENTRY = {"offset": 64, "stored_bytes": 32, "raw_bytes": 32, "payload_xxh3": 64, "first_key": 64, "type": 8, "group": 8,
         "level": 8, "record_count": 32}
SUPER = {"file_bytes": 64, "page_count": 32, "directory_pages": 32, "directory_offset": 64, "point_pages": 32,
         "node_pages": 32, "root_page": 32, "root_slot": 16, "levels": 16, "attribute_groups": 16, "reserved": 16,
         "leaf_points": 32, "points": 64, "nodes": 64, "node_groups": 64, "tail_offset": 64, "tail_pages": 16}
HEAD = {"point_bytes": 8, "page_shift": 8, "compat": 64, "ro_compat": 64, "minor": 16}
NUMBERS = ("origin", "edge", "bounds_low", "bounds_high", "area", "flux")

# Values of summaries are recomputed by one of the two, before it compares totals.
SUMS = {"nodes-node-mean", "nodes-node-sphere", "nodes-node-slab", "nodes-node-greatest", "nodes-node-sums",
        "nodes-node-emission", "nodes-node-cone"}


def draw(choice, bits):
    """Returns a random integer, often at an end of its range."""
    top = 1 << bits - 1
    return choice.choice((0, 1, 2, choice.randrange(9), top - 1, top, 2 * top - 2, 2 * top - 1,
                          choice.getrandbits(bits), choice.randrange(200)))


def draw_double(choice):
    bits = choice.choice((0, 1 << 63, 0x7FF << 52, 0x7FF8 << 48, 1, 0x3FF << 52, choice.getrandbits(64)))
    return struct.unpack("<d", struct.pack("<Q", bits))[0]


def change(choice, draft):
    """Changes one number of a page's payload, a header, an entry, both, the superblock or the file header."""
    page = choice.choice(draft.pages)
    what = choice.randrange(9)
    if what < 3:
        content = bytearray(page.payload if page.stored is None else page.stored)
        at, size = choice.randrange(len(content)), choice.choice((1, 2, 4, 8))
        at -= at % size
        size = min(size, len(content) - at)
        content[at:at + size] = draw(choice, 8 * size).to_bytes(size, "little")
        if page.stored is None:
            page.payload = content
        else:
            page.stored = bytes(content)
    elif what == 8:
        name = choice.choice(NUMBERS)
        one = name in ("edge", "area")
        draft.super[name] = draw_double(choice) if one else [draw_double(choice) for _ in range(3)]
    else:
        fields, *places = ((HEADER, page.header), (ENTRY, page.entry), (SUPER, draft.super),
                           ({k: ENTRY[k] for k in ENTRY if k != "offset"}, page.entry, page.header),
                           (HEAD, draft.head))[what - 3]
        name = choice.choice(list(fields))
        value = draw(choice, fields[name])
        for place in places:
            place[name] = value


def write_far(path):
    """Makes a container of one point whose attributes, nodes and directory lie after a hole of 4 GiB."""
    draft = Draft([Surfel((1, 2, 3), radius=0.5)], channels=good.CHANNELS)
    hole = draft.offset(1)
    for i, page in enumerate(draft.pages[1:], 1):
        page.entry["offset"] = draft.offset(i) + (1 << 32)
    plain = reader.unpack_superblock(draft.to_bytes()[-reader.BLOCK:])
    draft.super.update({name: getattr(plain, name) + (1 << 32) for name in ("file_bytes", "directory_offset", "tail_offset")})
    whole = draft.to_bytes()
    with open(path, "wb") as file:
        file.write(whole[:hole])
        file.seek(1 << 32, 1)
        file.write(whole[hole:])


class Readers(ProgramTest):
    def test_offsets_beyond_32_bits(self):
        path = self.here / "far.ptcx"
        write_far(path)
        container = reader.open_container(path)
        self.assertEqual([p.x for p in container.points()], [[1]])
        self.assertEqual(len(container.groups(0)[0]), 1)
        container.close()
        facts = json.loads(self.succeed("ptcinfo", path, "--json").stdout)
        self.assertEqual((facts["points"], facts["bytes"]["file"]), (1, path.stat().st_size))
        self.succeed("ptcconvert", path, self.here / "out.ptcx")

    def verdicts(self, path):
        try:
            verifier.verify(path)
            first = "valid"
        except reader.Broken as error:
            first = error.clause.removeprefix("spec/").replace(".md#", "-")
        result = run("ptcverify", path, "--json")
        self.assertIn(result.returncode, (0, 1, 4, 6), result.stderr)
        lines = [json.loads(line) for line in result.stdout.splitlines()]
        broken = {line["rule"].removeprefix("spec/").replace(".md#", "-") for line in lines[:-1]}
        self.assertEqual(result.returncode == 0, not broken)
        return first, broken or {"valid"}

    def test_they_agree(self):
        path, seen = self.here / "changed.ptcx", set()
        for seed in range(300):
            choice = random.Random(seed)
            draft = choice.choice(DRAFTS)()
            change(choice, draft)
            path.write_bytes(draft.to_bytes())
            first, found = self.verdicts(path)
            seen.add(first)
            if first == "valid" and found & SUMS:
                continue
            self.assertIn(first, found, f"seed {seed}")
        self.assertGreater(len(seen), 25)


if __name__ == "__main__":
    unittest.main()
