"""Files of points: what goes in comes out, in other formats, in order, from pipes and directories."""

import json
import struct
import subprocess
import unittest

from programs import BIN, SMALL_PICTURE, ProgramTest, ball, read_ply, write_ply

NAMES = ["x", "y", "z", "nx", "ny", "nz", "radius", "intensity", "number"]


def points_of(count):
    """Points of a ball with an intensity, and their place in the file as a number."""
    return [(*p[:7], 0.25 * i, float(i)) for i, p in enumerate(ball(count))]


def read_las(path):
    """Returns the version, the point format, the count, and the positions of a LAS file."""
    data = path.read_bytes()
    assert data[:4] == b"LASF"
    offset, = struct.unpack_from("<I", data, 96)
    kind, size = struct.unpack_from("<BH", data, 104)
    scale = struct.unpack_from("<3d", data, 131)
    shift = struct.unpack_from("<3d", data, 155)
    count, = struct.unpack_from("<Q", data, 247)
    places = [struct.unpack_from("<3i", data, offset + i * size) for i in range(count)]
    return data[24:26], kind, count, [tuple(v * s + o for v, s, o in zip(p, scale, shift)) for p in places]


class Formats(ProgramTest):
    def setUp(self):
        super().setUp()
        self.scan = self.here / "scan.ply"
        self.points = points_of(500)
        write_ply(self.scan, self.points, NAMES)

    def order(self, path):
        names, points = read_ply(path)
        return [round(p[names.index("number")]) for p in points]

    def test_attributes_are_channels_of_their_names(self):
        self.succeed("ptcbuild", self.scan, "-o", self.here / "a.ptcx")
        self.succeed("ptcverify", self.here / "a.ptcx", "--level", "4")
        facts = json.loads(self.succeed("ptcinfo", self.here / "a.ptcx", "--json").stdout)
        self.assertEqual({c["name"] for c in facts["channels"]}, {"intensity", "number"})

    def test_a_cloud_is_shaded_in_its_order_by_one_command(self):
        self.succeed("ptcshade", self.scan, "-o", self.here / "lit.ply")
        self.assertEqual(self.order(self.here / "lit.ply"), list(range(500)))
        names, _ = read_ply(self.here / "lit.ply")
        self.assertIn("occlusion", names)
        self.assertNotIn("original_index", names)

    def test_an_intensity_of_floats_fills_the_field_of_las_from_a_cloud_a_container_and_shading(self):
        self.succeed("ptcbuild", self.scan, "--original-order", "-o", self.here / "a.ptcx")
        said = "Values of the channel intensity, from 0 to 124.75, are rounded to integers."
        self.assertIn(said, self.succeed("ptcconvert", self.scan, self.here / "a.las", "--dry-run").stdout)
        self.assertIn(said, self.succeed("ptcconvert", self.here / "a.ptcx", self.here / "a.las", "--dry-run").stdout)
        self.succeed("ptcconvert", self.scan, self.here / "a.las")
        self.succeed("ptcconvert", self.here / "a.ptcx", self.here / "b.las", "--original-order")
        self.succeed("ptcshade", self.scan, "-o", self.here / "c.las")
        self.succeed("ptcshade", self.here / "a.ptcx", "-o", self.here / "d.las")
        for name in ("a.las", "b.las", "c.las", "d.las"):
            data = (self.here / name).read_bytes()
            begin, = struct.unpack_from("<I", data, 96)
            size, = struct.unpack_from("<H", data, 105)
            values = [struct.unpack_from("<H", data, begin + i * size + 12)[0] for i in range(500)]
            wanted = [int(0.25 * i + 0.5) for i in range(500)]
            self.assertEqual(sorted(values) if name == "d.las" else values, wanted, name)

    def write_las(self, path, sizes, extended=()):
        """Writes a LAS of 400 points of a plane with a record of each size. Returns the bytes of the records, extended ones last."""
        records = b"".join(struct.pack("<H16sHH32s", 0, b"someone", i, size, b"of a test") +
                           bytes((k * k >> 7) & 255 for k in range(size)) for i, size in enumerate(sizes))
        head = bytearray(375)
        head[:4], head[24], head[25] = b"LASF", 1, 4
        struct.pack_into("<HIIBH", head, 94, 375, 375 + len(records), len(sizes), 6, 30)
        struct.pack_into("<6d", head, 131, 0.01, 0.01, 0.01, 0, 0, 0)
        struct.pack_into("<6d", head, 179, 0.19, 0, 0.19, 0, 0, 0)
        struct.pack_into("<Q", head, 247, 400)
        points = b"".join(struct.pack("<iii18x", i % 20, i // 20, 0) for i in range(400))
        more = b"".join(struct.pack("<H16sHQ32s", 0, b"surveyor", i, size, b"extended") +
                        bytes((k * k >> 5) & 255 for k in range(size)) for i, size in enumerate(extended))
        if extended:
            struct.pack_into("<QI", head, 235, 375 + len(records) + len(points), len(extended))
        path.write_bytes(bytes(head) + records + points + more)
        return records + more

    def records_of(self, path):
        """Returns the bytes between the header and the points of a LAS file, without those of its extra bytes, and those behind the points."""
        data = path.read_bytes()
        begin, count = struct.unpack_from("<II", data, 96)
        size, = struct.unpack_from("<H", data, 105)
        behind, extended, points = struct.unpack_from("<QIQ", data, 235)
        end = begin + points * size
        self.assertEqual((behind, extended > 0), (end, True) if len(data) > end else (0, False))
        kept, at = b"", 375
        for _ in range(count):
            user, number, size = struct.unpack_from("<16sHH", data, at + 2)
            if (user.rstrip(b"\0"), number) != (b"LASF_Spec", 4):
                kept += data[at:at + 54 + size]
            at += 54 + size
        self.assertEqual(at, begin)
        return kept + data[end:]

    def test_long_records_of_las_come_out_again_and_a_container_keeps_16_kib(self):
        las, out, scene = self.here / "a.las", self.here / "b.las", self.here / "a.ptcx"
        sizes = [20000, 60000, 700, 65535, 20000, 60000, 15000, 900]
        records = self.write_las(las, sizes)
        self.assertEqual(self.succeed("ptcconvert", las, out).stderr, "")
        self.assertEqual(self.records_of(out), records)
        self.assertIn("nothing would be lost", self.succeed("ptcconvert", las, out, "--dry-run").stdout)
        # A container has no room for them, and says so
        left_out = [i for i, size in enumerate(sizes) if size > 15000 or i == 7]
        for command in (["ptcbuild", las, "-o", scene], ["ptcconvert", las, scene]):
            said = self.succeed(*command).stderr
            for i in left_out:
                self.assertIn(f"a.las: The record {i} of the user 'someone', {sizes[i]} bytes, is left out: "
                              "a container keeps only 16 KiB of records.\n", said)
            self.assertEqual(said.count("left out"), len(left_out))
            self.succeed("ptcverify", scene)
            self.succeed("ptcconvert", scene, out)
            self.assertEqual(len(self.records_of(out)), 2 * 54 + 700 + 15000)

    def test_extended_records_of_las_come_out_again_and_what_is_beyond_1_mib_is_named(self):
        las, out, scene = self.here / "a.las", self.here / "b.las", self.here / "a.ptcx"
        records = self.write_las(las, [300], [65535, 65536, 700000, 9, 0])
        self.assertEqual(self.succeed("ptcconvert", las, out).stderr, "")
        self.assertEqual(self.records_of(out), records)
        self.assertNotIn("left out", self.succeed("ptcshade", las, "-o", out).stderr)
        self.assertEqual(self.records_of(out), records)
        # A container keeps the short ones
        self.assertEqual(self.succeed("ptcbuild", las, "-o", scene).stderr.count("is left out: a container keeps"), 3)
        self.succeed("ptcverify", scene)
        self.succeed("ptcconvert", scene, out)
        self.assertEqual(self.records_of(out), records[:354] + records[-129:])
        # Above 1 MiB in all, those that do not fit are named
        self.write_las(las, [300], [700000, 400000, 9])
        said = "a.las: The record 1 of the user 'surveyor', 400000 bytes, is left out: only 1 MiB of records is kept.\n"
        for command in (["ptcconvert", las, out], ["ptcconvert", las, out, "--dry-run"], ["ptcshade", las, "-o", out]):
            with self.subTest(command):
                run = self.succeed(*command)
                self.assertEqual((run.stdout + run.stderr).count(said), 1)
        self.assertEqual(len(self.records_of(out)), 354 + 700060 + 69)

    def test_shading_a_las_keeps_its_long_records(self):
        las, out, other = self.here / "a.las", self.here / "b.las", self.here / "other.las"
        records = self.write_las(las, [20000, 60000, 700, 65535])
        short = self.write_las(other, [100])
        self.succeed("ptcbuild", other, "-o", self.here / "other.ptcx")
        for words, kept in (([las], records), ([las, "--count", "99"], records), ([las, other], records),
                            ([other, las], short), ([other, "--receivers", las], records),
                            ([las, "--receivers", other], short), ([las, "--receivers", self.here / "other.ptcx"], short)):
            self.assertNotIn("left out", self.succeed("ptcshade", *words, "-o", out).stderr)
            self.assertEqual(self.records_of(out), kept, words)
        # A container that is kept leaves them out; a picture has none
        self.assertEqual(self.succeed("ptcshade", las, "-o", self.here / "b.ptcx").stderr.count("left out"), 3)
        self.assertNotIn("left out", self.succeed("ptcrender", las, *SMALL_PICTURE, "-o", self.here / "b.png").stderr)

    def test_an_intensity_that_is_scaled_by_the_values_of_one_file_is_noted(self):
        def tile(name, values):
            path = self.here / name
            path.write_text(f"{len(values)}\n" + "".join(f"{i % 9} {i // 9} {i % 2} {v}\n" for i, v in enumerate(values)))
            return path
        dark, bright = tile("dark.pts", range(-1600, -1519)), tile("bright.pts", range(81))
        wide, out = tile("wide.pts", range(-9000, -8919)), self.here / "o.las"
        alike = "Another file may be scaled otherwise, by its own values; files that are joined are scaled alike."
        said = f"o.las: Values of the channel intensity, from -1600 to -1520, become 16 (v + 2048). {alike}\n"
        self.assertIn(said, self.succeed("ptcconvert", dark, out).stderr)
        self.assertIn(said, self.succeed("ptcshade", dark, "-o", out).stderr)
        self.assertIn(alike, self.succeed("ptcconvert", wide, out).stderr)
        self.assertEqual(self.succeed("ptcconvert", bright, out).stderr, "")
        self.assertEqual(self.succeed("ptcconvert", dark, self.here / "o.ply").stderr, "")
        self.succeed("ptcbuild", dark, bright, "--original-order", "-o", self.here / "a.ptcx")
        self.succeed("ptcconvert", self.here / "a.ptcx", out, "--original-order")
        data = out.read_bytes()
        (begin,), (size,) = struct.unpack_from("<I", data, 96), struct.unpack_from("<H", data, 105)
        values = [struct.unpack_from("<H", data, begin + i * size + 12)[0] for i in range(162)]
        self.assertEqual(values, [16 * (v + 2048) for v in (*range(-1600, -1519), *range(81))])

    def test_damage_that_is_tolerated_does_not_keep_channels_from_being_measured(self):
        scene, broken = self.here / "a.ptcx", self.here / "b.ptcx"
        self.succeed("ptcbuild", self.scan, "--page-size", "4K", "-o", scene)
        whole = bytearray(scene.read_bytes())
        for byte in (64, 65):  # of the first page, which holds points
            whole[4096 + byte] ^= 0xff
        broken.write_bytes(whole)
        self.fail_with(1, "ptcshade", broken, "-o", self.here / "o.las")
        self.succeed("ptcshade", broken, "-o", self.here / "o.las", "--tolerate-damage")
        self.assertIn("are rounded to integers", self.succeed("ptcconvert", broken, self.here / "o.las", "--dry-run").stdout)

    def test_the_order_comes_back_only_where_it_is_known(self):
        self.succeed("ptcbuild", self.scan, "-o", self.here / "a.ptcx")
        self.succeed("ptcbuild", self.scan, "--original-order", "-o", self.here / "b.ptcx")
        text = self.fail_with(2, "ptcconvert", self.here / "a.ptcx", self.here / "a.ply", "--original-order")
        self.assertIn("--original-order", text)
        self.succeed("ptcconvert", self.here / "b.ptcx", self.here / "b.ply", "--original-order")
        self.assertEqual(self.order(self.here / "b.ply"), list(range(500)))
        self.succeed("ptcconvert", self.here / "b.ptcx", self.here / "c.ply")
        self.assertNotEqual(self.order(self.here / "c.ply"), list(range(500)))

    def test_standard_input_a_directory_a_pattern_and_a_list_are_inputs(self):
        tiles = self.here / "tiles"
        tiles.mkdir()
        write_ply(tiles / "a.ply", self.points[:200], NAMES)
        write_ply(tiles / "b.ply", self.points[200:], NAMES)
        (tiles / "notes.md").write_text("no tile\n")
        (tiles / "readme.txt").write_text("Text beside clouds tells about them\n")
        (self.here / "list.txt").write_text("# tiles\ntiles/a.ply\n\ntiles/b.ply\n")
        made = []
        for i, given in enumerate([["tiles/a.ply", "tiles/b.ply"], ["tiles"], ["tiles/*.ply"], ["@list.txt"]]):
            self.succeed("ptcbuild", *given, "-o", f"{i}.ptcx", cwd=self.here)
            made.append((self.here / f"{i}.ptcx").read_bytes())
        self.assertEqual(len(set(made)), 1)
        piped = subprocess.run([BIN / "ptcbuild", "-", "-o", self.here / "p.ptcx"], stdin=open(self.scan, "rb"),
                               capture_output=True, text=True, timeout=60)
        self.assertEqual(piped.returncode, 0, piped.stderr)
        facts = json.loads(self.succeed("ptcinfo", self.here / "p.ptcx", "--json").stdout)
        self.assertEqual((facts["points"], facts["text"]["inputs"]), (500, "stdin"))
        self.assertEqual([p.name for p in self.here.iterdir() if p.name.startswith(".")], [])

    def test_inputs_that_stand_for_nothing_are_refused(self):
        (self.here / "empty").mkdir()
        (self.here / "none.txt").write_text("# nothing\n")
        for given, said in (("empty", "no mesh and no cloud"), ("*.las", "no file matches"), ("@none.txt", "names no file")):
            text = self.fail_with(1, "ptcbuild", given, "-o", "o.ptcx", cwd=self.here)
            self.assertIn(said, text)
        piped = subprocess.run([BIN / "ptcbuild", "-", "-o", self.here / "p.ptcx"], stdin=subprocess.DEVNULL,
                               capture_output=True, text=True, timeout=60)
        self.assertEqual(piped.returncode, 1)
        self.assertIn("standard input is empty", piped.stderr)

    def test_las_holds_what_the_container_has(self):
        self.succeed("ptcshade", self.scan, "-o", self.here / "lit.las")
        version, kind, count, places = read_las(self.here / "lit.las")
        self.assertEqual((version, count), (b"\1\4", 500))
        self.assertIn(kind, (6, 7))
        for place, point in zip(places, self.points):
            for a, b in zip(place, point):
                self.assertAlmostEqual(a, b, delta=1e-3)
        self.succeed("ptcconvert", self.here / "lit.las", self.here / "again.ply")
        names, again = read_ply(self.here / "again.ply")
        self.assertEqual(len(again), 500)
        self.assertIn("occlusion", names)

    def test_a_dry_run_writes_nothing_and_says_what_is_lost(self):
        self.succeed("ptcbuild", self.scan, "-o", self.here / "a.ptcx")
        before = sorted(self.here.iterdir())
        said = self.succeed("ptcconvert", self.here / "a.ptcx", self.here / "a.las", "--dry-run").stdout
        self.assertIn("500 points", said)
        self.assertEqual(sorted(self.here.iterdir()), before)

    def test_a_dry_run_speaks_of_rounding_only_where_a_number_is_rounded(self):
        cloud = self.here / "floats.ply"
        axes = "".join(f"property double {axis}\n" for axis in "xyz")
        head = f"ply\nformat ascii 1.0\nelement vertex 2\n{axes}property uint id\nend_header\n"
        for place, number, lost in (("0.125 0.75 -0.375", 7, []), ("0.1 0.7 -0.3", 7, ["float"]), ("0.125 0 0", 2**31, ["id"])):
            cloud.write_text(f"{head}0 0 0 {number}\n{place} 1\n")
            self.succeed("ptcbuild", cloud, "-o", self.here / "floats.ptcx")
            for source in (cloud, self.here / "floats.ptcx"):
                said = self.succeed("ptcconvert", source, self.here / "a.bgeo", "--dry-run", "--json").stdout
                about = [loss for loss in json.loads(said)["losses"] if "float" in loss or "id" in loss.split()]
                self.assertEqual(len(about), len(lost), (source, about))
                for word in lost:
                    self.assertIn(word, about[0])

    def test_a_dry_run_into_a_container_leaves_the_file_of_its_name(self):
        kept = self.here / "kept.ptcx"
        kept.write_text("anything")
        said = self.succeed("ptcconvert", self.scan, kept, "--dry-run").stdout
        self.assertIn("rounded to 2^-42", said)
        self.assertEqual(kept.read_text(), "anything")
        self.succeed("ptcbuild", self.scan, "-o", self.here / "a.ptcx")
        said = self.succeed("ptcconvert", self.here / "a.ptcx", kept, "--dry-run").stdout
        self.assertIn("nothing would be lost", said)
        said = self.succeed("ptcconvert", self.here / "a.ptcx", kept, "--dry-run", "--profile", "fast").stdout
        self.assertIn("0.001 radii", said)
        self.assertEqual(kept.read_text(), "anything")

    def test_a_selection_that_takes_nothing_says_so(self):
        self.succeed("ptcbuild", self.scan, "-o", self.here / "a.ptcx")
        said = self.succeed("ptcconvert", self.here / "a.ptcx", self.here / "a.ply", "--bbox=90,90,90,91,91,91").stderr
        self.assertIn("the selection takes no point", said)
        for option in ("--class=2", "--channels=occlusion"):
            self.assertIn("the clusters of a level", self.fail_with(2, "ptcconvert", self.here / "a.ptcx", self.here / "b.ply", "--level=2", option))

    def test_what_is_neither_cloud_nor_mesh_is_told_what_can_be_read(self):
        other = self.here / "passwords"
        other.write_text("root:x:0:0\n")
        self.assertIn("nothing that can be read", self.fail_with(1, "ptcconvert", other, self.here / "a.xyz"))

    def test_places_of_a_scan_are_as_they_were(self):
        header = b"ply\nformat binary_little_endian 1.0\nelement vertex 300\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
        places = [(500000.13 + i % 17 * 0.01, 4e6 + i // 17 * 0.03, i * i % 29 * 0.07) for i in range(300)]
        (self.here / "far.ply").write_bytes(header + b"".join(struct.pack("<3d", *p) for p in places))
        self.succeed("ptcshade", self.here / "far.ply", "-o", self.here / "lit.ply")
        names, points = read_ply(self.here / "lit.ply")
        for place, point in zip(places, points):
            for a, b in zip(place, point[:3]):
                self.assertAlmostEqual(a, b, delta=1e-9)

    def test_a_cloud_without_normals_and_light_is_lit(self):
        write_ply(self.here / "bare.ply", [p[:3] for p in ball(2000)], ["x", "y", "z"])
        said = self.succeed("ptcbuild", self.here / "bare.ply", "-o", self.here / "bare.ptcx").stderr
        self.assertIn("the normals of 2000 points are estimated", said)
        self.succeed("ptcshade", self.here / "bare.ptcx", "-o", self.here / "bare.ply")
        names, points = read_ply(self.here / "bare.ply")
        at = {name: i for i, name in enumerate(names)}
        outward = [sum(p[at[a]] * p[at["n" + a]] for a in "xyz") for p in points]
        self.assertGreater(min(outward), 0.9)  # the normals of a ball are its positions
        self.assertLess(max(p[at["occlusion"]] for p in points), 0.1)
        self.assertGreater(min(p[at["sky_g"]] for p in points), 2.8)  # pi in the open

    def test_a_format_that_must_have_normals_and_radii_has_none_to_give_back(self):
        write_ply(self.here / "bare.ply", [p[:3] for p in ball(2000)], ["x", "y", "z"])
        self.succeed("ptcconvert", self.here / "bare.ply", self.here / "bare.ptc")
        said = self.succeed("ptcbuild", self.here / "bare.ptc", "-o", self.here / "a.ptcx").stderr
        self.assertIn("the normals of 2000 points are estimated", said)
        self.succeed("ptcconvert", self.here / "a.ptcx", self.here / "a.ply")
        names, points = read_ply(self.here / "a.ply")
        self.assertGreater(min(p[names.index("radius")] for p in points), 0)

    def test_a_cloud_without_colours_gets_none(self):
        write_ply(self.here / "bare.ply", [p[:3] for p in ball(900)], ["x", "y", "z"])
        write_ply(self.here / "red.ply", [(*p[:3], 1, 0, 0) for p in ball(90)], ["x", "y", "z", "red", "green", "blue"])
        grey = ["albedo_r", "red"]
        for inputs, coloured in ((["bare.ply"], False), (["bare.ply", "red.ply"], True)):
            self.succeed("ptcbuild", *inputs, "-o", "a.ptcx", cwd=self.here)
            self.succeed("ptcconvert", "a.ptcx", "a.ply", cwd=self.here)
            self.succeed("ptcconvert", "a.ptcx", "b.ptcx", cwd=self.here)
            self.succeed("ptcconvert", "b.ptcx", "b.ply", cwd=self.here)
            for name in ("a.ply", "b.ply"):
                self.assertEqual([n in read_ply(self.here / name)[0] for n in grey], [coloured] * 2)
        self.succeed("ptcbuild", "bare.ply", "-o", "a.ptcx", cwd=self.here)
        self.succeed("ptcbuild", "red.ply", "--append", "a.ptcx", "-o", "b.ptcx", cwd=self.here)
        self.succeed("ptcconvert", "b.ptcx", "b.ply", cwd=self.here)
        self.assertIn("albedo_r", read_ply(self.here / "b.ply")[0])

    def test_the_axis_that_points_up_can_be_told_to_every_program_that_takes_a_cloud(self):
        floor = [(x * 0.1, y * 0.1, 0.001 * (x * y % 7)) for x in range(40) for y in range(40)]
        write_ply(self.here / "floor.ply", floor, ["x", "y", "z"])
        self.succeed("ptcshade", self.here / "floor.ply", "--up", "z", "-o", self.here / "up.ply")
        names, points = read_ply(self.here / "up.ply")
        up, sky = names.index("nz"), names.index("sky_g")
        self.assertGreater(min(p[up] for p in points), 0.5)
        self.assertGreater(sorted(p[sky] for p in points)[800], 3)
        self.fail_with(2, "ptcshade", self.here / "floor.ply", "--up", "q", "-o", self.here / "o.ply")

    def test_duplicates_go_on_request_and_are_counted(self):
        said = self.succeed("ptcbuild", self.scan, self.scan, "--remove-duplicates", "-o", self.here / "a.ptcx").stderr
        self.assertIn("500 points lie where another one does", said)
        facts = json.loads(self.succeed("ptcinfo", self.here / "a.ptcx", "--json").stdout)
        self.assertEqual(facts["points"], 500)
        self.succeed("ptcverify", self.here / "a.ptcx", "--level", "4")


if __name__ == "__main__":
    unittest.main()
