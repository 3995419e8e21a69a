"""Inputs: what the programs take in place of one container, and what they say of what they cannot take."""

import json
import os
import subprocess
import unittest

from programs import BIN, SMALL_PICTURE, ProgramTest, ball, read_ply, write_ply

NAMES = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"]


class Inputs(ProgramTest):
    def setUp(self):
        super().setUp()
        points = [point[:6] + point[10:] for point in ball(400)]
        self.tiles = self.here / "tiles"
        self.tiles.mkdir()
        write_ply(self.tiles / "a.ply", points[:200], NAMES)
        write_ply(self.tiles / "b.ply", points[200:], NAMES)

    def ways_to_name_the_tiles(self):
        (self.here / "tiles.txt").write_text("# both\ntiles/a.ply\ntiles/b.ply\n")
        return (["tiles/a.ply", "tiles/b.ply"], ["tiles"], ["tiles/*.ply"], ["@tiles.txt"])

    def test_a_picture_of_a_cloud_is_that_of_its_container(self):
        cloud = self.tiles / "a.ply"
        self.succeed("ptcbuild", cloud, "-o", self.here / "a.ptcx")
        self.succeed("ptcrender", self.here / "a.ptcx", "-o", self.here / "a.png", *SMALL_PICTURE)
        before = sorted(os.listdir(self.here))
        self.succeed("ptcrender", cloud, "-o", self.here / "b.png", *SMALL_PICTURE)
        self.assertEqual((self.here / "b.png").read_bytes(), (self.here / "a.png").read_bytes())
        self.assertEqual(sorted(os.listdir(self.here)), sorted(before + ["b.png"]))

    def test_a_picture_of_meshes_alone_shows_the_meshes(self):
        small = [*SMALL_PICTURE, "--backdrop"]
        self.succeed("ptcbuild", self.mesh, "--backdrop", "--points", "2k", "--sun", "30,60", "-o", self.here / "a.ptcx")
        self.succeed("ptcrender", self.here / "a.ptcx", "--mesh", self.mesh, "-o", self.here / "a.png", *small)
        self.succeed("ptcrender", self.mesh, "--points", "2k", "--sun", "30,60", "-o", self.here / "b.png", *small)
        self.assertEqual((self.here / "b.png").read_bytes(), (self.here / "a.png").read_bytes())

    def test_options_that_the_scene_leaves_without_effect_are_noted(self):
        for scene, option, why in ((self.scene, ["--up", "z"], "the scene is a container"),
                                   (self.cloud, ["--points", "9"], "no file of the scene is a mesh")):
            for program, target in (("ptcshade", "o.ply"), ("ptcrender", "o.png")):
                small = SMALL_PICTURE if program == "ptcrender" else []
                said = self.succeed(program, scene, *option, "-o", self.here / target, *small).stderr
                self.assertIn(f"{option[0]} has no effect, because {why}", said)

    def test_a_request_that_is_wrong_is_refused_before_the_build(self):
        said = self.fail_with(2, "ptcrender", self.tiles, "-o", self.here / "a.png", "--estimate", "--check", "9")
        self.assertIn("which only an .exr has", said)

    def test_a_build_that_fails_leaves_nothing(self):
        (self.tiles / "c.ply").write_bytes((self.tiles / "a.ply").read_bytes()[:-5])
        for program, target in (("ptcshade", "o.ply"), ("ptcrender", "o.png")):
            self.assertIn("c.ply: offset ", self.fail_with(1, program, self.tiles, "-o", self.here / target))

    def test_scenes_of_several_files_are_named_as_for_a_build(self):
        made = set()
        for names in self.ways_to_name_the_tiles():
            self.succeed("ptcrender", *names, "-o", self.here / "a.png", *SMALL_PICTURE, cwd=self.here)
            self.succeed("ptcshade", *names, "-o", self.here / "a.ply", cwd=self.here)
            made.add(((self.here / "a.png").read_bytes(), (self.here / "a.ply").read_bytes()))
        self.assertEqual(len(made), 1)
        self.assertEqual(len(read_ply(self.here / "a.ply")[1]), 400)

    def test_points_of_several_clouds_go_out_in_the_order_of_the_arguments(self):
        self.succeed("ptcshade", self.tiles / "b.ply", self.tiles / "a.ply", "-o", self.here / "o.ply")
        lit = read_ply(self.here / "o.ply")[1]
        came = read_ply(self.tiles / "b.ply")[1] + read_ply(self.tiles / "a.ply")[1]
        for a, b in zip(lit, came):
            for k in range(3):
                self.assertAlmostEqual(a[k], b[k], delta=1e-9)

    def test_containers_are_joined(self):
        for name in "ab":
            self.succeed("ptcbuild", self.tiles / f"{name}.ply", "-o", self.here / f"{name}.ptcx")
        self.succeed("ptcshade", self.here / "a.ptcx", self.here / "b.ptcx", "-o", self.here / "o.ptcx")
        self.assertEqual(json.loads(self.succeed("ptcinfo", self.here / "o.ptcx", "--json").stdout)["points"], 400)

    def test_scenes_are_read_from_standard_input(self):
        cloud = self.tiles / "a.ply"
        for program, options in (("ptcshade", ["-o", "o.ply"]), ("ptcrender", ["-o", "o.png", *SMALL_PICTURE])):
            self.succeed(program, cloud, *options, cwd=self.here)
            named = (self.here / options[1]).read_bytes()
            with cloud.open() as piped:
                self.succeed(program, "-", *options, cwd=self.here, stdin=piped)
            self.assertEqual((self.here / options[1]).read_bytes(), named)
        self.assertEqual([name for name in os.listdir(self.here) if name.startswith(".")], [])

    def test_standard_input_is_recorded_under_a_name_that_says_so(self):
        with (self.tiles / "a.ply").open() as piped:
            self.succeed("ptcshade", "-", "-o", self.here / "o.ptcx", stdin=piped)
        self.assertEqual(json.loads(self.succeed("ptcinfo", self.here / "o.ptcx", "--json").stdout)["text"]["inputs"], "stdin")

    def test_messages_call_standard_input_by_that_name(self):
        target = self.here / "o.ptcx"
        for program, arguments in (("ptcbuild", ["-", "-o", target]), ("ptcconvert", ["-", target]),
                                   ("ptcshade", ["-", "-o", target]),
                                   ("ptcrender", ["-", "-o", self.here / "o.png", *SMALL_PICTURE])):
            said = self.succeed(program, *arguments, input="1 2 3 0 0 1\n4 5 6 0 1 0\n").stderr
            self.assertIn(f"{program}: standard input: The file does not name its columns", said)
            self.assertNotIn(".stdin", said)
            (target if program != "ptcrender" else self.here / "o.png").unlink()
            said = self.fail_with(1, program, *arguments, "--format", "xyz", input="1 2 3\n4 five 6\n")
            self.assertIn(f"{program}: standard input: line 2: column 2: 'five' is not a number", said)

    def test_standard_input_may_be_packed(self):
        lines = "".join("%g %g %g\n" % point[:3] for point in ball(60))
        packed = subprocess.run(["gzip", "-c"], input=lines.encode(), capture_output=True, check=True).stdout
        built = subprocess.run([str(BIN / "ptcbuild"), "-", "-o", "o.ptcx"], input=packed, cwd=self.here, capture_output=True)
        self.assertEqual(built.returncode, 0, built.stderr)

    def test_text_that_is_not_read_gets_a_hint(self):
        other = self.here / "scan.dat"
        other.write_text("Easting Northing Height\n1 2 3\n")
        said = self.fail_with(1, "ptcbuild", other, "-o", self.here / "o.ptcx")
        self.assertIn("nothing that can be read", said)
        self.assertIn("end its name in .xyz, or state --format xyz for standard input", said)

    def test_standard_input_can_be_named_once(self):
        with (self.tiles / "a.ply").open() as piped:
            said = self.fail_with(1, "ptcshade", "-", "-", "-o", self.here / "o.ply", stdin=piped)
        self.assertIn("standard input is named twice, but can be read once", said)

    def test_what_cannot_be_named_is_told(self):
        (self.here / "empty").mkdir()
        for program, target in (("ptcshade", "o.ply"), ("ptcrender", "o.png")):
            for name, why in (("no*", "no file matches"), ("no.las", "No such file"), ("empty", "holds no mesh and no cloud"),
                              ("@no.txt", "No such file")):
                self.assertIn(why, self.fail_with(1, program, name, "-o", target, cwd=self.here))

    def test_ptcinfo_prints_what_the_header_of_a_cloud_states(self):
        self.succeed("ptcconvert", self.tiles / "a.ply", self.here / "a.las")
        told = self.succeed("ptcinfo", self.here / "a.las").stdout
        self.assertIn("LAS 1.4, point format ", told)
        self.assertIn("\n  points    200\n", told)
        self.assertRegex(told, r"\n  bounds    -?0\.\d+ .* to .*, as the header states\n")
        self.assertIn("\n  channel   rgb: 3 x u16", told)
        facts = json.loads(self.succeed("ptcinfo", self.here / "a.las", "--json").stdout)
        self.assertEqual((facts["points"], facts["colours"], facts["radii"]), (200, True, False))
        for k in range(3):
            places = [point[k] for point in read_ply(self.tiles / "a.ply")[1]]
            self.assertAlmostEqual(facts["bounds"]["low"][k], min(places), delta=1e-3)
            self.assertAlmostEqual(facts["bounds"]["high"][k], max(places), delta=1e-3)

    def test_ptcinfo_does_not_count_the_lines_of_a_text(self):
        (self.here / "a.xyz").write_text("1 2 3\n4 5 6\n")
        self.assertIn("points    not counted", self.succeed("ptcinfo", self.here / "a.xyz").stdout)
        self.assertIsNone(json.loads(self.succeed("ptcinfo", self.here / "a.xyz", "--json").stdout)["points"])

    def test_what_takes_containers_alone_names_the_command_that_builds_one(self):
        for arguments in (["ptcinfo", self.mesh], ["ptcverify", self.mesh], ["ptcverify", self.cloud],
                          ["ptcinfo", self.cloud, "--thumbnail", self.here / "o.png"]):
            built = f"ptcbuild {arguments[1]} -o {arguments[1].stem}.ptcx"
            self.assertTrue(self.fail_with(1, *arguments).endswith(f": {built}\n"))
            self.succeed(*built.split(), "--points", "1k", cwd=self.here)
        (self.here / "note").write_text("neither\n")
        for program in ("ptcinfo", "ptcverify"):
            self.assertNotIn("ptcbuild", self.fail_with(1, program, self.here / "note"))


if __name__ == "__main__":
    unittest.main()
