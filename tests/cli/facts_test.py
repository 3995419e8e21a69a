"""The facts that the programs report, which do not depend on threads or memory."""

import gzip
import json
import math
import re
import struct
import subprocess
import sys
import unittest
from pathlib import Path

from programs import CORE, SMALL_PICTURE, WRITTEN, ProgramTest, ball, read_ply, run, run_on_terminal, write_ply

VECTORS = Path(__file__).resolve().parents[2] / "spec/vectors"


class Facts(ProgramTest):
    def test_ptcinfo_names_what_a_container_holds(self):
        facts = json.loads(self.succeed("ptcinfo", self.scene, "--json").stdout)
        for key in ("format_version", "points", "nodes", "levels", "bounds", "channels", "bytes", "codec",
                    "page_size", "peak_resident_bytes"):
            self.assertIn(key, facts)
        self.assertEqual(facts["format_version"], "1.0")
        self.assertEqual(facts["points"], 600)
        self.assertEqual(facts["page_size"], 65536)
        self.assertEqual(facts["codec"], "zstd")
        self.assertEqual(facts["bytes"]["file"], self.scene.stat().st_size)
        for key in ("point_pages", "node_pages"):
            self.assertGreater(facts["bytes"][key], 0)
        for low, high in zip(facts["bounds"]["low"], facts["bounds"]["high"]):
            self.assertAlmostEqual(low, -1, places=2)
            self.assertAlmostEqual(high, 1, places=2)

    def test_ptcinfo_prints_what_a_reader_of_its_summary_asks_for(self):
        scene = self.here / "o.ptcx"
        self.succeed("ptcbuild", self.mesh, "--spacing", "0.05", "--sun", "30,60", "--sun", "60,30", "--point=0,2,0,1,1,1",
                     "--spot=0,2,0,0,-1,0,40,0.2,1,1,1",
                     "-o", scene)
        told = self.succeed("ptcinfo", scene).stdout
        facts = json.loads(self.succeed("ptcinfo", scene, "--json").stdout)
        for line in (f"pages     {facts['pages']} of 65.5 KB", 'inputs    "box.obj"', "spacing   0.05 scene units between surfels of meshes",
                     "lights    2 suns, 1 point light, 1 spot light, no sky", "rounded   position by at most 0.001 of the point's radius, the radius by "
                     "1/512 of it, normals by 0.0021 rad, radiance by 1/256 of it"):
            self.assertIn(f"\n  {line}\n", told)
        bounds = re.search(r"\n  bounds    (\S+) (\S+) (\S+) to (\S+) (\S+) (\S+)\n", told).groups()
        exact = facts["bounds"]["low"] + facts["bounds"]["high"]
        for text, value in zip(bounds, exact):
            self.assertAlmostEqual(float(text), value, delta=1e-6)
            self.assertLessEqual(len(text.lstrip("-").replace(".", "").lstrip("0")), 7, text)
        self.succeed("ptcbuild", self.mesh, "--points", "1k", "-o", scene)
        self.assertIn("lights    1 sun, 0 point lights, 0 spot lights, a sky\n", self.succeed("ptcinfo", scene).stdout)
        far = self.here / "far.ply"
        write_ply(far, [(point[0] + 4.5e6, *point[1:]) for point in ball(100)])
        self.succeed("ptcbuild", far, "-o", scene)
        self.assertRegex(self.succeed("ptcinfo", scene).stdout, r"\n  bounds    4499999\.\d{4,6} -0\.\d+ ")
        for vector in VECTORS.glob("good/*.ptcx"):
            self.assertIn("\n  bounds    ", self.succeed("ptcinfo", vector, "--memory", "1G").stdout)

    def test_a_tolerance_saves_bytes_and_is_explained(self):
        usual, small, again = (self.here / name for name in ("u.ptcx", "s.ptcx", "t.ptcx"))
        self.succeed("ptcbuild", self.mesh, "--points", "100k", "--no-default-lights", "-o", usual)
        told = json.loads(self.succeed("ptcbuild", self.mesh, "--points", "100k", "--no-default-lights",
                                       "--tolerance", "3%", "-o", small, "--json").stdout)
        self.assertTrue(told["tolerance"]["met"])
        self.assertEqual(told["tolerance"]["asked"], 0.03)
        self.assertLessEqual(told["tolerance"]["high"], 0.03)
        self.assertEqual(told["points"], told["tolerance"]["points"])
        self.assertLess(small.stat().st_size, usual.stat().st_size / 2)
        self.succeed("ptcverify", small)
        why = self.succeed("ptcinfo", small, "--why").stdout
        self.assertIn("\n  why       a tolerance of 3 % was asked for: what arrives at points is ", why)
        self.assertRegex(why, r"\n  merged    \d+ of \d+ points lie in cells that are flat and evenly lit, and \d+ surfels stand for them\n")
        self.assertRegex(why, r"\n  position  \d\.\d\d bytes a point\n")
        self.assertIn("\n  leaves    of at most 32 points: ", why)
        self.assertIn("\n  why       no tolerance was asked for, so no points are merged\n", self.succeed("ptcinfo", usual, "--why").stdout)
        facts = json.loads(self.succeed("ptcinfo", usual, "--why", "--json").stdout)["why"]
        bytes_of_all = facts["bytes_per_point"]
        self.assertEqual(set(bytes_of_all), {"position", "radius", "normal", "radiance", "albedo", "flags"})
        self.assertNotIn("simplified", facts)
        # The same container, by another way: ptcconvert takes the profile that a tolerance needs
        self.succeed("ptcbuild", self.mesh, "--points", "100k", "--no-default-lights", "--profile", "exact", "-o", usual)
        self.succeed("ptcconvert", usual, again, "--tolerance", "3%")
        self.assertEqual(json.loads(self.succeed("ptcinfo", again, "--json").stdout)["points"], told["points"])
        for code, arguments, complaint in ((2, ("ptcconvert", usual, again, "--tolerance", "3%", "--profile", "exact"), "fast or compact"),
                                           (2, ("ptcbuild", self.mesh, "-o", again, "--tolerance", "0"), "above 0 and at most 1"),
                                           (2, ("ptcbuild", self.mesh, "-o", again, "--tolerance", "3%", "--resume"), "--tolerance"),
                                           (1, ("ptcinfo", self.cloud, "--why"), "is about what containers store")):
            self.assertIn(complaint, self.fail_with(code, *arguments))

    def test_lights_take_the_group_that_was_named_before_them(self):
        scene = self.here / "o.ptcx"
        self.succeed("ptclight", self.scene, "--point", "0,3,0,1", "--light-group", "a", "--sun", "30,60", "--point", "0,4,0,1",
                     "--light-group", "b_2", "--spot", "0,2,0,0,-1,0,40,0.2,1", "--sky", "0.5", "--sun", "60,30", "-o", scene)
        lights = json.loads(json.loads(self.succeed("ptcinfo", scene, "--json").stdout)["text"]["lights"])
        self.assertEqual([light.get("group") for light in lights["suns"]], ["a", "b_2"])
        self.assertEqual([light.get("group") for light in lights["points"]], [None, "a"])
        self.assertEqual([light.get("group") for light in lights["spots"] + [lights["sky"]]], ["b_2", "b_2"])
        self.assertIn("a sky; in groups: a b_2 rest\n", self.succeed("ptcinfo", scene).stdout)
        out = self.here / "o.ply"
        self.succeed("ptcshade", scene, "--light-groups", "-o", out)
        names, shaded = read_ply(out)
        for axis in "rgb":
            for point in (dict(zip(names, values)) for values in shaded):
                together = sum(point[f"light_{group}_{axis}"] for group in ("a", "b_2", "rest"))
                bounced = point[f"albedo_{axis}"] / math.pi * point[f"irradiance_{axis}"]
                self.assertAlmostEqual(together, point[f"radiance_{axis}"] + bounced, delta=0.01)
        for wrong, told in ((["--light-group", "a"], "expects a light after the name of its group, not 'a'"),
                            (["--light-group", "a", "--light-group", "b", "--sun", "3,4"], "expects a light after the name of its group, not 'a'"),
                            (["--sun", "3,4", "--light-group", "b"], "expects a light after the name of its group, not 'b'"),
                            (["--light-group", "rest", "--sun", "3,4"], "and not rest")):
            self.assertIn(told, self.fail_with(2, "ptclight", self.scene, *wrong, "-o", scene))

    def test_lights_are_recorded_in_watts_whatever_their_unit(self):
        scene = self.here / "o.ptcx"

        def recorded(*options):
            self.succeed("ptcbuild", self.mesh, "--points", "500", *options, "-o", scene)
            return json.loads(json.loads(self.succeed("ptcinfo", scene, "--json").stdout)["text"]["lights"])

        sphere = 4 * math.pi
        for text, intensity in (("2", [2, 2, 2]), ("1,2,3", [1, 2, 3]), ("100W", [100 / sphere] * 3),
                                ("1,2,4W", [1 / sphere, 2 / sphere, 4 / sphere]), ("683cd", [1, 1, 1]), ("1.5e3cd", [1500 / 683] * 3),
                                ("800lm", [800 / 683 / sphere] * 3)):
            lights = recorded("--point", f"0,5,0,{text}", "--spot", f"1,5,0,0,-2,0,40,0.25,{text}")
            for light in lights["points"] + lights["spots"]:
                for is_, was in zip(light["intensity"], intensity, strict=True):
                    self.assertAlmostEqual(is_, was, delta=1e-6 * was)
        spot = lights["spots"][0]
        self.assertEqual((spot["position"], spot["direction"]), ([1, 5, 0], [0, -1, 0]))
        self.assertAlmostEqual(spot["inner_angle"], math.radians(30), places=6)
        self.assertAlmostEqual(spot["outer_angle"], math.radians(40), places=6)
        for text, irradiance in (("", 3), (",5", 5), (",683lx", 1), (",1e5lx", 1e5 / 683)):
            self.assertAlmostEqual(recorded("--sun", f"30,60{text}")["suns"][0]["irradiance"][0], irradiance, delta=1e-6 * irradiance)

    def test_ptcinfo_under_a_cap_that_does_not_hold_the_directory_is_refused(self):
        def least_and_pages(points):
            scene = self.here / "scene.ptcx"
            self.succeed("ptcbuild", self.mesh, "--points", points, "--page-size", "4K", "-o", scene)
            pages = json.loads(self.succeed("ptcinfo", scene, "--json").stdout)["page_counts"]
            refused, enough = 0, 1 << 20
            while enough - refused > 1:
                cap = (refused + enough) // 2
                code = run("ptcinfo", scene, "--memory", cap).returncode
                self.assertIn(code, (0, 5))
                refused, enough = (cap, enough) if code == 5 else (refused, cap)
            self.assertIn("the least that works is 1M", self.fail_with(5, "ptcinfo", scene, "--memory", refused))
            return enough, sum(pages.values())

        few, few_pages = least_and_pages("100")
        many, many_pages = least_and_pages("20k")
        self.assertGreater(many_pages, few_pages + 50)
        self.assertEqual(many - few, 120 * (many_pages - few_pages))  # bytes of a page while the file opens

    def test_texts_of_a_file_cannot_command_the_terminal(self):
        vector = Path(__file__).resolve().parents[2] / "spec/vectors/good/texts.ptcx"
        told = self.succeed("ptcinfo", vector).stdout
        self.assertIn("rounded", told)
        self.assertTrue(all(" " <= c <= "~" for line in told.split("\n") for c in line), told)

    def test_every_program_tells_machines(self):
        picture = ["-o", self.here / "o.png", *SMALL_PICTURE]
        common = {"seconds", "memory_bytes", "peak_resident_bytes", "cpu_seconds"}
        for command, keys in (
                (["ptcbuild", self.mesh, "--points", "1k", "-o", self.here / "o.ptcx"],
                 {"points", "nodes", "bytes", "pages", "sort"}),
                (["ptcshade", self.scene, "-o", self.here / "o.ply"], {"receivers", "gather", "cache"}),
                (["ptclight", self.scene, "--sun", "30,60", "-o", self.here / "o.ptcx"], {"points", "shadow_rays", "cache"}),
                (["ptcrender", self.scene, *picture], {"receivers", "gather", "cache"}),
                (["ptcconvert", self.scene, self.here / "p.ptcx"], {"points", "nodes", "bytes", "pages"}),
                (["ptcverify", self.scene], {"points", "nodes", "bytes", "pages"})):
            facts = json.loads(self.succeed(*command, "--json").stdout)
            self.assertLessEqual(keys | common, set(facts), command[0])
            self.assertGreater(facts["peak_resident_bytes"], 1 << 20)
        shade = json.loads(self.succeed("ptcshade", self.scene, "-o", self.here / "o.ply", "--json").stdout)
        cache = shade["cache"]
        self.assertEqual(cache["lookups"], cache["local_hits"] + cache["shared_hits"] + cache["misses"])

    def test_the_room_that_a_build_takes_is_told_before_it_begins(self):
        first, second = self.here / "first", self.here / "second"
        first.mkdir()
        second.mkdir()
        command = ["ptcbuild", "--city", "700k", "--memory", "102M", "--temp", first, "--temp", second, "-o", self.here / "o.ptcx"]
        result = self.succeed(*command, "--json")
        space = json.loads(result.stdout)["space"]
        self.assertEqual(space["temp_bytes"], 700_000 * 34)
        for key in ("temp_free_bytes", "output_bytes", "output_free_bytes"):
            self.assertGreater(space[key], 1 << 20)
        # Both directories are on one disk, whose room is counted once.
        self.assertLess(abs(space["temp_free_bytes"] - space["output_free_bytes"]), 0.5 * space["output_free_bytes"])
        told = self.succeed(*command, "--progress").stderr
        for text in (f"ptcbuild: 23.8 MB of temporary files in {first} and {second}, ", " GB free; about 9.1 MB for "):
            self.assertIn(text, told)
            self.assertIn(text, result.stderr)
        self.assertLess(told.index("temporary files"), told.index("partition"))
        self.assertEqual(self.succeed(*command, "--quiet").stderr, "")
        self.assertFalse([*first.iterdir(), *second.iterdir()])
        self.assertEqual(self.succeed("ptcbuild", self.cloud, "--up", "y", "-o", self.here / "o.ptcx").stderr, "")

    def test_what_the_disks_have_no_room_for_is_refused_with_both_figures(self):
        for options in (["--city", "80G"], ["--city", "80G", "--temp", "/dev/shm"]):
            message = run("ptcbuild", *options, "--memory", "16G", "-o", self.here / "o.ptcx")
            self.assertEqual(message.returncode, 3)
            self.assertRegex(message.stderr, r"take (up to|about) \d+\.\d GB in .*, with \d+\.\d GB free")
        self.assertFalse(list(self.here.iterdir()))

    def test_bounces_are_told_and_add_light(self):
        facts = {}
        for program, name in (("ptcshade", "o.ply"), ("ptcrender", "o.png")):
            picture = SMALL_PICTURE if program == "ptcrender" else []
            for bounces in (1, 3):
                facts = json.loads(self.succeed(program, self.scene, "-o", self.here / name, *picture,
                                                "--bounces", bounces, "--json").stdout)
                self.assertEqual(facts["bounces"], bounces)
                self.assertEqual(list(facts["settings"]), ["solid_angle", "parallax", "resolution", "inflation"])
                if program == "ptcshade":
                    self.assertEqual(list(facts["settings"].values())[2:], [32, 2])
                self.assertEqual(facts["bounce_cpu_seconds"] > 0, bounces > 1)
                self.assertEqual([s for s in facts["seconds"] if s.startswith("bounce")],
                                 ["bounce 1", "bounce 2"] if bounces > 1 else [])
        self.assertFalse([p.name for p in self.here.iterdir() if p.name.startswith(".")])

    def test_a_build_tells_how_many_surfels_an_error_takes(self):
        few, many = self.here / "few.ptcx", self.here / "many.ptcx"
        for scene, asked in ((few, 0.5), (many, 0.2)):
            facts = json.loads(self.succeed("ptcbuild", self.mesh, "--error", f"{100 * asked}%", "-o", scene, "--json").stdout)
            error = facts["error"]
            self.assertEqual((error["asked"], error["met"]), (asked, True))
            self.assertLessEqual(error["high"], asked)
            self.assertEqual((error["points"], error["bytes"]), (facts["points"], scene.stat().st_size))
            self.assertEqual({trial["adapts"] for trial in error["trials"][:2]}, {False, True})
            self.assertIn(error["count"], [trial["count"] for trial in error["trials"]])
            self.assertIn("choose surfels", facts["seconds"])
        self.assertLess(few.stat().st_size, many.stat().st_size)
        summary = self.succeed("ptcbuild", self.mesh, "--error", "20%", "-o", many).stdout
        self.assertRegex(summary, r"error: 20 % asked, [\d.]+ % \[[\d.]+, [\d.]+\] measured against the meshes with "
                                  rf"{error['points']} (even|adapted) surfels, {len(error['trials'])} trials")
        self.assertIn("all inputs are meshes", self.fail_with(2, "ptcbuild", self.cloud, "--error", "5%", "-o", few))
        for other in (["--points", "1k"], ["--spacing", "0.1"], ["--adapt"], ["--append", self.scene]):
            self.fail_with(2, "ptcbuild", self.mesh, "--error", "5%", *other, "-o", few)

    def test_without_bounces_there_is_occlusion_alone(self):
        scene = self.here / "s.ptcx"
        self.succeed("ptcbuild", self.mesh, "--points", "1k", "-o", scene)
        columns = {}
        for bounces in (0, 1):
            out = self.here / f"o{bounces}.ply"
            facts = json.loads(self.succeed("ptcshade", scene, "-o", out, "--bounces", bounces, "--check", "20",
                                            "--json").stdout)
            names, points = read_ply(out)
            columns[bounces] = dict(zip(names, zip(*points)))
            discs = facts["check"]["discs"]
            self.assertGreater(discs["occlusion_mean"], 0)
            self.assertEqual(discs["irradiance_mean"] > 0, bounces > 0)
        self.assertEqual(columns[0]["occlusion"], columns[1]["occlusion"])
        self.assertGreater(max(columns[1]["irradiance_g"]), 0)
        self.assertEqual(max(columns[0]["irradiance_g"]), 0)
        tuned = json.loads(self.succeed("ptcshade", scene, "-o", self.here / "o.ply", "--bounces", "0", "--error", "5%",
                                        "--json").stdout)
        self.assertEqual(tuned["tuning"]["measured"]["irradiance_mean"], 0)

    def test_quiet_programs_say_nothing(self):
        for command in (["ptcinfo", self.scene], ["ptcverify", self.scene],
                        ["ptcbuild", self.cloud, "-o", self.here / "o.ptcx"],
                        ["ptcconvert", self.scene, self.here / "o.ply"]):
            result = self.succeed(*command, "--quiet", "--progress")
            self.assertEqual((result.stdout, result.stderr), ("", ""))

    def test_progress_without_a_terminal_is_plain_lines(self):
        for command in (["ptcverify", self.scene], ["ptcbuild", self.cloud, "--up", "y", "-o", self.here / "o.ptcx"],
                        ["ptcshade", self.scene, "-o", self.here / "o.ply"]):
            text = self.succeed(*command, "--progress").stderr
            self.assertGreaterEqual(len(text.splitlines()), 2)
            self.assertNotIn("\r", text)
            self.assertEqual(self.succeed(*command).stderr, "")

    def test_a_stage_that_counts_nothing_has_no_count_and_no_rate(self):
        text = self.succeed("ptcbuild", self.mesh, "--points", "3k", "-o", self.here / "o.ptcx", "--progress").stderr
        self.assertRegex(text, r"^read\nread: [0-9.]+ s\nsample and light\n")

    def test_a_terminal_shows_a_bar_that_goes_and_a_quiet_one_nothing(self):
        dense = self.here / "dense.ptcx"  # shaded in several times the 0.1 s after which a bar is drawn
        self.succeed("ptcbuild", self.mesh, "--points", "8000", "-o", dense)
        command = ["ptcshade", dense, "-o", self.here / "o.ply", "--solid-angle", "0.001", "--parallax", "0.02",
                   "--resolution", "64", "--threads", "1"]
        code, shown = run_on_terminal(*command)
        self.assertEqual(code, 0, shown)
        self.assertIn("\rshade [#", shown)
        self.assertTrue(shown.endswith("\r\x1b[K"), shown)
        self.assertNotIn("\n", shown)
        self.assertEqual(run_on_terminal(*command, "--quiet"), (0, ""))
        code, shown = run_on_terminal(*command, "--progress")
        self.assertRegex(shown, r"\rshade: [^\r]* points in [^\r]*\x1b\[K\r\n$")

    def test_a_check_against_rays_is_reported(self):
        facts = json.loads(self.succeed("ptcshade", self.scene, "-o", self.here / "o.ply", "--check", "20",
                                        "--check-rays", "64", "--json").stdout)
        self.assertGreaterEqual(facts["check"]["receivers"], 20)
        self.assertIn("occlusion_rms", facts["check"]["discs"])

    def test_radii_that_no_scene_has_are_shaded_as_rays_see_them(self):
        cloud, scene, out = self.here / "c.ply", self.here / "c.ptcx", self.here / "o.ply"
        for radius in (1e19, 1e20, 1e30, 3e38):
            for which in (range(90, 91), range(180)):  # one disc, all discs
                points = [list(point) for point in ball(180)]
                for i in which:
                    points[i][CORE.index("radius")] = radius
                write_ply(cloud, points)
                self.succeed("ptcbuild", cloud, "-o", scene)
                self.succeed("ptcverify", scene, "--level", "4")
                shade = ["ptcshade", scene, "-o", out, "--json"]
                for options in (["--count", "100", "--error", "5%", "--estimate"], ["--bounces", "2", "--lift", "100"],
                                ["--receivers", self.scene]):
                    facts = json.loads(self.succeed(*shade, *options, "--check", "20", "--check-rays", "1024").stdout)
                    discs = facts["check"]["discs"]
                    self.assertLess(discs["occlusion_rms"], 0.01, (radius, options))
                    self.assertLess(discs["irradiance_rms"] * discs["irradiance_mean"], 0.02, (radius, options))
                names, shaded = read_ply(out)
                for name in names[len(WRITTEN):]:
                    self.assertTrue(all(math.isfinite(point[names.index(name)]) for point in shaded), name)
                facts = json.loads(self.succeed("ptcrender", scene, "-o", self.here / "o.png", *SMALL_PICTURE, "--check", "20",
                                                "--json").stdout)
                self.assertLess(facts["check"]["discs"]["occlusion_rms"], 0.01, radius)
                self.succeed("ptcrender", scene, "--mesh", self.mesh, "-o", self.here / "o.png", *SMALL_PICTURE, "--check", "9")

    def test_an_error_is_asked_for_met_and_measured(self):
        picture = ["-o", self.here / "o.png", *SMALL_PICTURE]
        for program, operands in (("ptcshade", [self.box, "-o", self.here / "o.ply"]), ("ptcrender", [self.box, *picture])):
            for text in ("10%", "0.1"):
                command = [program, *operands, "--error", text, "--check", "100"]
                facts = json.loads(self.succeed(*command, "--json").stdout)
                self.assertEqual(facts["tuning"]["asked"], 0.1)
                self.assertTrue(facts["tuning"]["met"])
                # Pilots are a sample: with 2,000 to 4,000 surfels the check of 100 finds 0.099 to 0.117.
                self.assertLessEqual(facts["check"]["discs"]["relative"], 0.125)
                self.assertIn("error: 10 % asked", self.succeed(*command).stdout)
        below = ["ptcshade", self.box, "-o", self.here / "o.ply", "--error", "0.001%"]
        self.assertFalse(json.loads(self.succeed(*below, "--json").stdout)["tuning"]["met"])
        self.assertIn("below the floor", self.succeed(*below).stdout)

    def test_an_error_that_is_measured_and_not_confirmed_is_called_so(self):
        command = ["ptcshade", self.box, "-o", self.here / "o.ply", "--error"]
        floor = json.loads(self.succeed(*command, "0.001%", "--json").stdout)["tuning"]["measured"]["relative"]
        for factor in (1.02, 1.05, 1.1, 1.2):
            tuning = json.loads(self.succeed(*command, factor * floor, "--json").stdout)["tuning"]
            if not tuning["met"] and tuning["measured"]["relative"] <= tuning["asked"]:
                break
        else:
            self.fail("no error between the floor and what is confirmed was found")
        told = self.succeed(*command, factor * floor).stdout
        self.assertIn("% asked cannot be confirmed: the finest setting (", told)
        measured = tuning["measured"]["relative"]
        self.assertLess(tuning["low"], measured)
        self.assertGreater(tuning["high"], measured)
        bounds = f"[{100 * tuning['low']:.2f}, {100 * tuning['high']:.2f}]"
        self.assertIn(f") has {100 * measured:.2f} % {bounds} at {tuning['pilots']} pilot receivers, but ", told)
        self.assertNotIn("floor", told)

    def test_estimates_are_written_and_what_they_are_worth_is_told(self):
        out = self.here / "o.ply"
        command = ["ptcshade", self.box, "-o", out, "--error", "10%", "--estimate", "--check", "100"]
        facts = json.loads(self.succeed(*command, "--json").stdout)
        self.assertGreater(facts["estimate"]["cpu_seconds"], 0)
        for quantity in ("occlusion", "irradiance"):
            self.assertIn("rank", facts["check"]["estimate"][quantity])
        names, points = read_ply(out)
        columns = dict(zip(names, zip(*points)))
        self.assertGreater(max(columns["occlusion_error"]), 0)
        self.assertGreaterEqual(min(columns["irradiance_error"]), 0)
        self.assertIn("estimates of occlusion", self.succeed(*command).stdout)

    def test_pictures_are_written_in_every_layer(self):
        layers = [f"--layer={name}={self.here}/{name}.png" for name in ("direct", "indirect", "occlusion", "albedo")]
        told = self.succeed("ptcrender", self.box, "--mesh", self.mesh, "-o", self.here / "o.exr",
                            "-o", self.here / "o.png", *layers, *SMALL_PICTURE).stdout
        written = ("o.exr", "o.png", "direct.png", "indirect.png", "occlusion.png", "albedo.png")
        self.assertTrue(told.startswith(", ".join(f"{self.here}/{name}" for name in written) + ": "), told)
        self.assertEqual((self.here / "o.exr").read_bytes()[:4], b"\x76\x2f\x31\x01")
        for name in ("o", "direct", "indirect", "occlusion", "albedo"):
            png = (self.here / (name + ".png")).read_bytes()
            self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
            self.assertEqual(struct.unpack(">II", png[16:24]), (24, 16))


class Verify(ProgramTest):
    def test_whole_containers_are_valid(self):
        self.assertIn("valid", self.succeed("ptcverify", self.scene).stdout)
        self.assertIn("valid", self.succeed("ptcverify", self.box, "--threads", "1").stdout)

    def test_a_verification_tells_what_its_level_looked_at_and_nothing_else(self):
        whole = json.loads(self.succeed("ptcinfo", self.scene, "--json").stdout)
        counted = {"points": whole["points"], "nodes": whole["nodes"], "node_groups": whole["node_groups"],
                   "levels": whole["levels"]}
        pages = whole["pages"]
        texts = ["header, superblocks and length", f"directory and headers of {pages} pages", f"checksums of {pages} pages",
                 f"{pages} pages, 600 points, {whole['nodes']} nodes in {whole['node_groups']} groups",
                 f"{pages} pages, 600 points, {whole['nodes']} nodes in {whole['node_groups']} groups, the tree built again"]
        for level, text in enumerate(texts):
            command = ["ptcverify", self.scene, "--level", str(level)]
            told = self.succeed(*command).stdout
            self.assertRegex(told, rf": valid at level {level}: {re.escape(text)}, [0-9.]+ KB, [0-9.]+ s\n$")
            facts = json.loads(self.succeed(*command, "--json").stdout)
            self.assertEqual((facts["pages"], facts["damaged_pages"]), (pages, 0) if level > 0 else (None, None))
            for name, value in counted.items():
                self.assertEqual(facts[name], value if level > 2 else None, (level, name))
        path = self.here / "wrong.ptcx"
        content = bytearray(self.scene.read_bytes())
        content[4096 + 100] ^= 1  # a byte of the first page
        path.write_bytes(content)
        for level in (2, 3, 4):
            told = run("ptcverify", path, "--level", level).stderr
            self.assertIn(f"damaged: 1 fault in 1 of {pages} pages at level {level}: test memory and disk", told)
        content[-2000] ^= 1  # a byte of a superblock
        path.write_bytes(content)
        self.assertRegex(run("ptcverify", path, "--level", "0").stderr, r"damaged: 1 fault at level 0: ")
        self.assertRegex(run("ptcverify", path, "--level", "3").stderr, rf"damaged: 2 faults in 1 of {pages} pages at level 3: ")
        facts = json.loads(run("ptcverify", path, "--level", "3", "--json").stdout.splitlines()[-1])
        self.assertEqual((facts["points"], facts["damaged_pages"]), (0, 1))

    def test_another_kind_of_file_is_called_so_and_not_damaged(self):
        for level in (0, 1, 3):
            self.assertEqual(self.fail_with(1, "ptcverify", self.cloud, "--level", level),
                             f"ptcverify: {self.cloud}: not a PTCX file (spec/container.md#header-magic). Only containers can "
                             f"be checked; to build one of it: ptcbuild {self.cloud} -o ball.ptcx\n")
        packed = self.here / "scene.gz"
        packed.write_bytes(gzip.compress(self.scene.read_bytes()))
        self.assertIn(": not a PTCX file: it is a gzip file (", self.fail_with(1, "ptcverify", packed))
        path, kept = self.here / "wrong.ptcx", self.here / "kept.ptcx"
        path.write_bytes(b"noise---" * 512 + self.scene.read_bytes()[4096:])
        result = run("ptcverify", path, "--salvage", kept)
        self.assertEqual(result.returncode, 1)
        self.assertIn("at level 3: its beginning is overwritten; keep the undamaged part with --salvage\n", result.stderr)
        self.succeed("ptcverify", kept)

    def test_a_flipped_byte_is_named_by_offset_and_rule(self):
        whole = self.scene.read_bytes()
        path = self.here / "flipped.ptcx"
        for offset in range(50, len(whole), 1777):
            flipped = bytearray(whole)
            flipped[offset] ^= 0x40
            path.write_bytes(flipped)
            message = self.fail_with(1, "ptcverify", path)
            self.assertRegex(message, rf"{path}: offset \d+: .+ \(spec/[a-z]+\.md#[a-z0-9-]+\); bit-flip")

    def test_exit_codes_tell_what_is_wrong(self):
        whole = self.scene.read_bytes()
        path = self.here / "wrong.ptcx"
        newer = (VECTORS / "bad/container-header-version.ptcx").read_bytes()
        directory, tail = (struct.unpack_from("<Q", whole, len(whole) - 4096 + field)[0] for field in (136, 200))
        for code, content, cause in ((0, whole, None), (1, whole[:5000] + b"x" + whole[5001:], None),
                                     (1, whole + b"more", "appended"), (1, whole.replace(b"\n", b"\r\n"), "text-mode"),
                                     (4, newer, "newer"), (6, whole[:-9], "truncated"), (6, whole[:tail], "truncated"),
                                     (6, whole[:directory], "unfinished")):
            path.write_bytes(content)
            result = run("ptcverify", path, "--json")
            self.assertEqual(result.returncode, code, (cause, result.stdout, result.stderr))
            lines = [json.loads(line) for line in result.stdout.splitlines()]
            self.assertEqual(lines[-1]["valid"], code == 0)
            self.assertEqual(lines[-1]["damage"], len(lines) - 1)
            for line in lines[:-1]:
                self.assertEqual(line["rule"].split("#")[1], line["code"])
                self.assertTrue(line["hint"])
            if cause:
                self.assertEqual(lines[0]["cause"], cause)
        self.fail_with(5, "ptcverify", self.scene, "--memory", "1M")

    def test_what_is_whole_is_salvaged_and_said(self):
        whole = self.scene.read_bytes()
        path, kept = self.here / "wrong.ptcx", self.here / "kept.ptcx"
        path.write_bytes(bytes(4096) + whole[4096:])
        result = run("ptcverify", path, "--salvage", kept, "--json")
        self.assertEqual(result.returncode, 1)
        self.assertIn("salvaged 600 of 600 points (100.00 %)", result.stderr)
        facts = json.loads(result.stdout.splitlines()[-1])
        self.assertEqual(facts["salvage"]["points"], 600)
        self.assertEqual(facts["salvage"]["energy_share"], 1)
        self.succeed("ptcverify", kept, "--level", "4")
        kept.unlink()
        path.write_bytes(whole[:20000])
        result = run("ptcverify", path, "--salvage", kept, "--json")
        self.assertEqual(result.returncode, 6)
        self.assertIn("salvaged 600 points in 1 of 1 pages; how many there were is not known", result.stderr)
        facts = json.loads(result.stdout.splitlines()[-1])
        self.assertEqual((facts["salvage"]["points"], facts["salvage"]["points_before"]), (600, None))
        self.assertIsNone(facts["salvage"]["energy_share"])
        self.succeed("ptcverify", kept, "--level", "4")
        kept.unlink()
        path.write_bytes(bytes(4096) + whole[4096:20000])
        result = run("ptcverify", path, "--salvage", kept, "--json")
        self.assertEqual(result.returncode, 1)
        self.assertIn("neither the header nor a superblock is whole", result.stderr)
        self.assertIsNone(json.loads(result.stdout.splitlines()[-1])["salvage"])
        self.assertFalse(kept.exists())
        self.fail_with(2, "ptcverify", self.scene, "--salvage", self.scene)

    def test_damage_stops_a_shading_unless_it_is_tolerated(self):
        scene, broken, out = self.here / "many.ptcx", self.here / "broken.ptcx", self.here / "o.ply"
        self.succeed("ptcbuild", self.mesh, "--points", "3k", "--page-size", "4K", "-o", scene)
        whole = bytearray(scene.read_bytes())
        for byte in (64, 65):  # bytes of the first page, which holds points
            whole[4096 + byte] ^= 0xff
        broken.write_bytes(whole)
        number, count = (struct.unpack_from("<I", whole, 4096 + field)[0] for field in (8, 20))  # rank, record_count
        points = json.loads(self.succeed("ptcinfo", scene, "--json").stdout)["points"]
        message = self.fail_with(1, "ptcshade", broken, "-o", out)
        why = f"broken.ptcx: offset 4160: page {number}: payload's checksum is wrong"
        self.assertIn(why, message)
        self.assertIn(why, run("ptcverify", broken).stderr)
        for command in (["ptcrender", broken, "-o", self.here / "o.png", *SMALL_PICTURE], ["ptcshade", broken, "-o", self.here / "o.ptcx"],
                        ["ptcshade", broken, "-o", out, "--bounces", "2"], ["ptcshade", scene, "--receivers", broken, "-o", out],
                        ["ptcconvert", broken, out], ["ptcconvert", broken, self.here / "o.xyz"],
                        ["ptcconvert", broken, self.here / "o.ptcx"], ["ptcconvert", broken, self.here / "o.ptcx", "--page-size", "8K"],
                        ["ptcbuild", self.cloud, "--append", broken, "-o", self.here / "o.ptcx"]):
            self.assertIn(why, self.fail_with(1, *command))
        self.assertFalse(out.exists())
        result = self.succeed("ptcshade", broken, "-o", out, "--tolerate-damage", "--json")
        damage = json.loads(result.stdout)["damage"]
        self.assertEqual([page["page"] for page in damage["pages"]], [number])
        self.assertEqual(damage["points"], count)
        self.assertGreater(damage["stand_ins"], 0)
        self.assertGreater(damage["max_bound"], damage["mean_bound"])
        self.assertGreater(damage["mean_bound"], 0)
        self.assertEqual(len(read_ply(out)[1]), points - count)
        for options in (["--bounces", "2"], ["--check", "20"], ["--error", "5%"]):
            self.fail_with(2, "ptcshade", broken, "-o", out, "--tolerate-damage", *options)
        self.fail_with(2, "ptcshade", broken, "-o", self.here / "o.ptcx", "--tolerate-damage")
        self.succeed("ptcshade", broken, "--receivers", scene, "-o", self.here / "o.ptcx", "--tolerate-damage")
        self.fail_with(1, "ptcrender", broken, "-o", self.here / "o.png", *SMALL_PICTURE)
        told = self.succeed("ptcrender", broken, "-o", self.here / "o.png", *SMALL_PICTURE, "--tolerate-damage").stdout
        self.assertIn(f"damaged: 1 page: {self.here}/{why}", told)
        told = self.succeed("ptcshade", scene, "-o", out, "--tolerate-damage").stdout
        self.assertIn("no page that was needed is damaged", told)

    def test_a_map_of_the_damage_is_drawn(self):
        path = self.here / "wrong.ptcx"
        path.write_bytes(self.scene.read_bytes()[:-9])
        for ending, magic in (("svg", b"<?xml"), ("png", b"\x89PNG")):
            picture = self.here / f"map.{ending}"
            self.assertEqual(run("ptcverify", path, "--map", picture).returncode, 6)
            self.assertTrue(picture.read_bytes().startswith(magic))
        self.assertIn(b"bytes shorter than its superblock says", (self.here / "map.svg").read_bytes())


class Determinism(ProgramTest):
    def test_threads_and_caps_do_not_change_what_is_written(self):
        for program, operands, name in (("ptcbuild", [self.mesh, "--points", "4k"], "o.ptcx"),
                                        ("ptclight", [self.scene, "--sun", "30,60", "--sky", "0.5"], "o.ptcx"),
                                        ("ptcshade", [self.scene], "o.ptcx"),
                                        ("ptcshade", [self.scene], "o.ply"),
                                        ("ptcshade", [self.scene, "--bounces", "3"], "o.ptcx")):
            first = None
            for options in (["--threads", "1"], ["--threads", "2"], ["--threads", "5"],
                            ["--memory", "148M"], ["--temp", str(self.here)]):
                self.succeed(program, *operands, *options, "-o", self.here / name)
                data = (self.here / name).read_bytes()
                first = first or data
                self.assertEqual(data, first, options)

    def test_the_page_of_the_demo_is_made_of_the_facts_of_its_programs(self):
        scene, cap = self.here / "scene.ptcx", ["--memory", "200M"]
        picture = ["ptcrender", scene, "--mesh", self.mesh, *SMALL_PICTURE, "-o", self.here / "o.png"]
        runs = {"build": ["ptcbuild", self.mesh, "--points", "3k", *cap, "-o", scene], "verify": ["ptcverify", scene],
                "shade": ["ptcshade", scene, *cap, "-o", self.here / "o.ply"], "render": picture + cap,
                "check": [*picture, "--check", "20", "--check-rays", "16"]}
        for name, command in runs.items():
            (self.here / f"{name}.json").write_text(self.succeed(*command, "--json").stdout)
        summary = Path(__file__).resolve().parents[2] / "tools/demo_summary.py"
        page = subprocess.run([sys.executable, summary, self.here], capture_output=True, text=True, check=True,
                              timeout=60).stdout
        rows = {row[0]: row[1:] for row in re.findall(r"^\| (\w+) \| ([0-9.]+) \| ([0-9.]+) \| (\d+) \| (\d+) \|$", page,
                                                      re.MULTILINE)}
        self.assertEqual({name: row[3] for name, row in rows.items()},
                         {"build": "200", "verify": "2048", "shade": "200", "render": "200"})
        peak = json.loads((self.here / "build.json").read_text())["peak_resident_bytes"]
        self.assertEqual(rows["build"][2], f"{peak / 2**20:.0f}")
        self.assertRegex(page, r"\n\| the mesh \| 0\.\d+ \|")


if __name__ == "__main__":
    unittest.main()
