"""ptcbench: what it measures, writes and refuses. Nothing here depends on the speed of the machine."""

import csv
import json
import os
import subprocess
import sys
import unittest

from programs import ProgramTest, ball, write_ply

METHODS = ["ptcx", "ptcx-rays", "plain", "embree-discs", "embree-mesh"]


class Bench(ProgramTest):
    def measure(self, *arguments):
        """Returns the rows and references of a small run."""
        charts = self.here / "charts"
        self.succeed("ptcbench", "accuracy", *arguments, "-o", charts, "--quick", "--quiet", "--checked", "20",
                     "--repeats", "1", "--reference-rays", "256")
        self.assertFalse([p.name for p in charts.iterdir() if p.name.startswith(".")])
        return json.loads((charts / "accuracy.json").read_text())

    def names(self, facts, key):
        return sorted({row[key] for row in facts["rows"]})

    def test_finer_settings_are_closer_to_the_truth(self):
        # Two settings of PTCX; rays and the plain gather are timed as always.
        charts = self.here / "charts"
        settings = ["--setting", "0.06,0.3,32", "--setting", "0.005,0.07,32"]
        printed = self.succeed("ptcbench", "accuracy", "fractal", "--quick", "--points", "20k", "--checked", "20",
                               "--repeats", "1", "--reference-rays", "4096", *settings, "-o", charts, "--json")
        facts = json.loads((charts / "accuracy.json").read_text())
        self.assertEqual(json.loads(printed.stdout)["rows"], facts["rows"])
        for place in ("camera", "points", "sparse"):
            for job in ("occlusion", "bleeding"):
                rows = [r for r in facts["rows"] if r["set"] == place and r["job"] == job]
                self.assertEqual(sorted({r["method"] for r in rows}), sorted(METHODS))
                coarse, fine = (r for r in rows if r["method"] == "ptcx")
                self.assertLess(fine["ao_rms"], 0.7 * coarse["ao_rms"])
                self.assertLess(fine["ao_rms"], 0.02)
                if job == "bleeding":
                    self.assertLess(fine["e_rms"], 0.7 * coarse["e_rms"])
                    self.assertLess(fine["e_rms"], 0.04)
                rays = [r for r in rows if r["method"] == "embree-discs"]
                self.assertEqual([r["setting"].split()[0] for r in rays], ["64", "256", "1024", "4096"])
                self.assertLess(rays[3]["ao_rms"], 0.25 * rays[0]["ao_rms"])
                own = [r for r in rows if r["method"] == "ptcx-rays"]
                self.assertEqual([r["setting"] for r in own], ["64 rays", "256 rays", "1024 rays", "4096 rays"])
                self.assertLess(own[3]["ao_rms"], 0.25 * own[0]["ao_rms"])
                self.assertTrue(all(r["us_per_receiver"] > 0 for r in rows))
        for note in facts["references"]:  # well below the measured errors
            self.assertLess(note["ao_noise"], 0.005)
            self.assertLess(note["e_noise"], 0.01)
        for name in ("accuracy", "accuracy-fractal"):
            self.assertIn("</svg>", (charts / (name + ".svg")).read_text())
            self.assertEqual((charts / (name + ".png")).read_bytes()[:4], b"\x89PNG")
        with open(charts / "accuracy.csv", newline="") as file:
            lines = list(csv.reader(file))
        self.assertEqual(lines[0], list(facts["rows"][0]))
        self.assertEqual([len(line) for line in lines], [len(lines[0])] * (len(facts["rows"]) + 1))

    def test_only_what_was_asked_for_is_measured(self):
        facts = self.measure(self.mesh, "--method", "ptcx", "--set", "points", "--setting", "0.02,0.1,16",
                             "--setting", "0.02,0.1,16,1.2")
        self.assertEqual(self.names(facts, "method"), ["ptcx"])
        self.assertEqual(self.names(facts, "set"), ["points"])
        self.assertEqual(self.names(facts, "setting"), ["0.02 sr, 0.1 rad, R 16", "0.02 sr, 0.1 rad, R 16, x 1.2"])
        facts = self.measure(self.mesh, "--method", "plain", "--method=embree-mesh", "--points", "2k")
        self.assertEqual(self.names(facts, "method"), ["embree-mesh", "plain"])
        self.assertEqual(self.names(facts, "set"), ["camera", "points", "sparse"])

    def test_errors_that_were_asked_for_are_met(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "error", "fractal", "--quick", "--points", "5k", "--checked", "50", "-o", charts,
                               "--json")
        facts = json.loads((charts / "error.json").read_text())
        self.assertEqual(json.loads(printed.stdout)["rows"], facts["rows"])
        self.assertEqual([r["asked"] for r in facts["rows"]], [a for a in (0.1, 0.05, 0.03, 0.02) for _ in range(3)])
        for row in facts["rows"]:
            self.assertGreater(row["measured"], 0)
            if row["met"]:
                self.assertLessEqual(row["measured"], row["asked"])
        self.assertTrue(facts["rows"][0]["met"])
        errors = [r["error"] for r in facts["ladder"]]
        self.assertLess(errors[-1], errors[0] / 5)
        self.assertEqual([s["scene"] for s in facts["slopes"]], ["fractal"])
        self.assertLess(facts["slopes"][0]["slope"], -0.4)
        self.assertEqual(sorted(p.name for p in charts.iterdir()),
                         ["error-ladder.csv", "error-slopes.csv", "error.csv", "error.json", "error.png", "error.svg"])

    def test_a_cloud_has_no_mesh_to_be_measured(self):
        cloud = self.here / "balls.ply"
        lower = [(p[0], p[1], p[2] - 2.2, *p[3:]) for p in ball(600, 2)]
        write_ply(cloud, ball(600) + lower)
        facts = self.measure(cloud)
        self.assertEqual(self.names(facts, "method"), ["embree-discs", "plain", "ptcx", "ptcx-rays"])
        self.assertTrue(all(row["ao_rms_mesh"] is None and row["speedup_mesh"] is None for row in facts["rows"]))
        message = self.fail_with(1, "ptcbench", "accuracy", cloud, "--method", "embree-mesh", "--quick", "--checked",
                                 "10", "-o", self.here / "charts")
        self.assertIn("balls: nothing to measure", message)

    def test_scenes_of_one_name_have_charts_of_their_own(self):
        for folder in ("a", "b"):
            (self.here / folder).mkdir()
            (self.here / folder / "box.obj").write_text(self.mesh.read_text())
        few = ["--method", "embree-mesh", "--set", "points", "--points", "1k"]
        facts = self.measure(self.here / "a/box.obj", self.here / "b/box.obj+backdrop", *few)
        self.assertEqual(self.names(facts, "scene"), ["box", "box-2"])
        for name in ("box", "box-2"):
            self.assertTrue((self.here / f"charts/accuracy-{name}.svg").is_file())

    def test_growth_measures_every_panel_and_leaves_its_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "growth", "--quick", "--points", "2k", "--points", "4k", "--checked", "10",
                               "--repeats", "1", "--threads", "2", "-o", charts, "--json")
        rows = json.loads((charts / "growth.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        panels = {name: [r for r in rows if r["panel"] == name] for name in ("surfels", "solid-angle", "depth", "cap")}
        self.assertEqual([len(panel) for panel in panels.values()], [2, 5, 5, 6])
        self.assertTrue(all(r["us_per_receiver"] > 0 and r["e_rms"] is not None for r in rows))
        self.assertEqual(len({r["e_rms"] for r in panels["cap"]}), 1)
        self.assertEqual([r["threads"] for r in panels["cap"]], [1, 1, 1, 2, 2, 2])
        self.assertEqual(sorted(p.name for p in charts.iterdir()),
                         ["growth.csv", "growth.json", "growth.png", "growth.svg"])
        with open(charts / "growth.csv", newline="") as file:
            lines = list(csv.reader(file))
        self.assertEqual([len(line) for line in lines], [len(lines[0])] * (len(rows) + 1))

    def test_model_measures_every_part_and_leaves_its_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "model", self.mesh, "--quick", "--points", "3k", "--checked", "20", "--repeats", "1",
                               "-o", charts, "--json")
        rows = json.loads((charts / "model.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        axes = [row["axis"] for row in rows]
        self.assertEqual({axis: axes.count(axis) for axis in axes},
                         {"payload": 51, "node": 6, "leaf": 6, "directions": 4, "pages": 22})
        self.assertTrue(all(row["decode_ns"] if row["axis"] == "pages" else row["us_per_receiver"] for row in rows))
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["model-box.png", "model-box.svg", "model-scenes.csv", "model.csv", "model.json"])

    def test_normals_of_clouds_are_compared_with_the_mesh(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "scan", "fractal", self.mesh, "--points", "40k", "--repeats", "1", "-o", charts, "--json")
        rows = json.loads((charts / "scan.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        self.assertEqual([(r["noise"], r["method"]) for r in rows], 2 * [(0, "ptcx"), (0.5, "ptcx")])
        for row in rows:
            self.assertEqual(row["points"], 40000)
            self.assertLessEqual(row["median_degrees"], row["p95_degrees"])
            self.assertGreater(row["points_per_cpu_second"], 0)
        for clean, noisy in (rows[:2], rows[2:]):
            self.assertLess(clean["median_degrees"], noisy["median_degrees"])
        self.assertLess(rows[2]["flipped"], 0.01)  # the ball is closed
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["scan.csv", "scan.json", "scan.png", "scan.svg"])

    def test_occlusion_of_scans_is_compared_with_the_mesh(self):
        charts = self.here / "charts"
        self.succeed("ptcbench", "specks", self.mesh, "--points", "20k", "--checked", "300", "-o", charts)
        rows = json.loads((charts / "specks.json").read_text())["rows"]
        self.assertEqual([r["cloud"] for r in rows], ["clean", "noise of half a spacing", "density 10 to 1", "200 holes"])
        for row in rows:
            self.assertLess(row["rms"], 0.1)
            self.assertLess(row["picture_rms"], 0.15)  # most of it at edges
            self.assertEqual(row["checked"], 300)
        self.assertLess(rows[0]["holes"], 0.01)
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["specks.csv", "specks.json"])

    def test_new_light_is_compared_with_the_mesh(self):
        charts = self.here / "charts"
        self.succeed("ptcbench", "relight", "fractal", "--quick", "-o", charts)
        rows = json.loads((charts / "relight.json").read_text())["rows"]
        sun = [("ptclight", f"{n} rays") for n in (4, 16, 64)] + [("embree-mesh", f"{n} rays") for n in (4, 16, 64)]
        sky = [("ptclight", "0.06 sr, 0.3 rad, R 32"), ("ptclight", "default")] + sun[3:]
        self.assertEqual([(r["light"], r["method"], r["setting"]) for r in rows],
                         [(light, *method) for light, methods in (("sun", sun), ("sun of 11 degrees", sun), ("sky", sky))
                          for method in methods])
        for row in rows:
            self.assertEqual(row["scene"], "fractal")
            self.assertLess(abs(row["mean"]), 0.05)
            self.assertLess(row["rms"], 0.4 if row["light"] == "sun" else 0.3)
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["relight.csv", "relight.json", "relight.png", "relight.svg"])

    def test_reflections_are_compared_with_many_more_rays(self):
        charts = self.here / "charts"
        self.succeed("ptcbench", "glossy", "city", "--quick", "-o", charts)
        rows = json.loads((charts / "glossy.json").read_text())["rows"]
        self.assertEqual([(r["roughness"], r["method"], r["rays"]) for r in rows],
                         [(roughness, method, rays) for roughness in (0.1, 0.3, 0.6, 1.0)
                          for method in ("ptcx", "embree-discs") for rays in (16, 64, 256)])
        for row in rows:
            self.assertLess(row["occlusion"], 0.15)
            self.assertLess(abs(row["bias"]), 0.1)
            self.assertGreater(row["noise"], 0)
        self.assertLess(rows[2]["radiance"], 0.3)
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["glossy.csv", "glossy.json", "glossy.png", "glossy.svg"])

    def test_scenes_that_are_drawn_by_chance_are_judged_and_shrunk(self):
        charts = self.here / "charts"
        self.succeed("ptcbench", "hunt", "--quick", "--scenes", "4", "-o", charts)
        facts = json.loads((charts / "hunt.json").read_text())
        self.assertEqual(len(facts["rows"]), 3)
        for row in facts["rows"]:
            self.assertLessEqual(row["median"], row["worst"])
            self.assertLess(row["worst"], 0.2)
        self.assertEqual(len(facts["worst"]), 3)
        for row in facts["worst"]:
            self.assertIn("receiver ", row["text"])
        self.assertGreater(len(facts["kept"]), 5)
        self.assertEqual({row["holds"] for row in facts["kept"]}, {"yes"})
        self.assertEqual(sorted(p.name for p in charts.iterdir()),
                         ["hunt-kept.csv", "hunt-worst.csv", "hunt.csv", "hunt.json", "hunt.png", "hunt.svg"])

    def test_pictures_of_rooms_are_compared_with_paths(self):
        charts, pictures = self.here / "charts", self.here / "pictures"
        self.succeed("ptcbench", "rooms", "cornell", "box-lamp", "--quick", "--points", "10k", "--pictures", pictures, "-o", charts)
        rows = json.loads((charts / "rooms.json").read_text())["rows"]
        self.assertEqual([r["scene"] for r in rows], ["cornell", "box-lamp"])
        for row in rows:
            self.assertLess(abs(row["bias"]), 0.1)
            self.assertGreater(row["judged"], 0.5)
            self.assertGreater(row["noise_hdr_flip"], 0)
        self.assertEqual(sorted(p.name for p in charts.iterdir()),
                         ["rooms-box-lamp.png", "rooms-cornell.png", "rooms.csv", "rooms.json"])
        self.assertEqual(sorted(p.name for p in pictures.iterdir()), ["box-lamp.exr", "cornell.exr"])

    def check_truth(self, judge, *arguments):
        charts = self.here / "charts"
        self.succeed("ptcbench", "truth", "cornell", "--quick", *arguments, "-o", charts)
        rows = json.loads((charts / "truth.json").read_text())["rows"]
        self.assertEqual([(r["scene"], r["bounces"]) for r in rows], [("cornell", 1), ("cornell", 2)])
        for row in rows:
            self.assertRegex(row["judge"], judge)
            self.assertLess(abs(row["bias"]), 0.03)
            self.assertLess(row["rms"], 0.08)
            self.assertGreater(row["judged"], 0.5)
            self.assertGreater(row["noise"], 0)
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["truth-cornell.png", "truth.csv", "truth.json"])

    def test_pictures_of_bounces_are_compared_with_our_paths(self):
        self.check_truth("^own paths$")

    def test_pictures_of_bounces_are_compared_with_mitsuba(self):
        python = os.environ.get("PTC_MITSUBA_PYTHON", sys.executable)
        if subprocess.run([python, "-c", "import mitsuba"], capture_output=True).returncode:
            self.skipTest("Mitsuba 3 is not installed: pip install mitsuba, and name the Python in PTC_MITSUBA_PYTHON")
        self.check_truth("^Mitsuba 3", "--python", python)

    def test_a_python_without_mitsuba_is_told(self):
        (self.here / "charts").mkdir()
        message = self.fail_with(1, "ptcbench", "truth", "cornell", "--quick", "--points", "2k", "--python", "false",
                                 "-o", self.here / "charts")
        self.assertIn("false cannot run Mitsuba", message)

    def test_files_are_joined_to_one_room(self):
        charts = self.here / "charts"
        ground = self.here / "ground.obj"
        ground.write_text("v -9 -1 9\nv 9 -1 9\nv 0 -1 -9\nf 1 2 3\n")
        self.succeed("ptcbench", "rooms", self.mesh, ground, "--join", "--quick", "--points", "2k", "--paths", "32",
                     "--sun", "30,60", "--camera", "3,2,5,0,0,0", "--size", "32x24", "-o", charts)
        rows = json.loads((charts / "rooms.json").read_text())["rows"]
        alone = self.here / "alone"
        self.succeed("ptcbench", "rooms", self.mesh, "--quick", "--points", "2k", "--paths", "32", "--size", "32x24",
                     "-o", alone)
        single = json.loads((alone / "rooms.json").read_text())["rows"]
        self.assertEqual([r["scene"] for r in rows], ["box"])
        self.assertEqual(rows[0]["triangles"], single[0]["triangles"] + 1)
        self.assertIn("only files can be joined", self.fail_with(2, "ptcbench", "rooms", "cornell", ground, "--join",
                                                                 "-o", charts))

    def test_points_are_written_and_read_in_every_format(self):
        charts = self.here / "charts"
        cloud = self.here / "more.xyz"
        cloud.write_text("".join(f"{x} {y} 0\n" for x in range(9) for y in range(9)))
        self.succeed("ptcbench", "formats", cloud, "--quick", "-o", charts)
        rows = json.loads((charts / "formats.json").read_text())["rows"]
        both = [".ply", ".las", ".pcd", ".xyz", ".bgeo", ".ptc"]
        self.assertEqual([(r["file"], r["work"]) for r in rows],
                         [(f, w) for f in both for w in ("write", "read")] +
                         [(".usdc", "write"), (".usda", "write"), ("more.xyz", "read")])
        for row in rows[:2 * len(both):2]:
            exact = row["file"] in (".ply", ".xyz")
            self.assertLess(row["difference"], 1e-15 if exact else 1e-4)
        self.assertEqual(rows[-1]["points"], 81)
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["formats.csv", "formats.json"])

    def test_scans_are_not_drawn_from_a_cloud(self):
        cloud = self.here / "cloud.xyz"
        cloud.write_text("".join(f"{x} {y} 0\n" for x in range(9) for y in range(9)))
        for experiment in ("rooms", "scan", "specks"):
            message = self.fail_with(1, "ptcbench", experiment, cloud, "--points", "1k", "-o", self.here / "charts")
            self.assertIn("cloud.xyz: has no triangles", message)

    def test_sorts_of_every_order_are_right_and_leave_their_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "sort", "--points", "40k", "--repeats", "1", "--memory", "1M", "--threads", "2", "-o", charts,
                               "--json")
        rows = json.loads((charts / "sort.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        orders = {"city", "random", "sorted", "reversed", "equal", "clusters"}
        self.assertEqual({(r["panel"], r["order"], r["method"]) for r in rows},
                         {("memory", o, m) for o in orders for m in ("ptcx", "tbb", "std::sort", "memcpy")}
                         | {("disk", o, m) for o in orders for m in ("ptcx", "floor")})
        for row in rows:
            self.assertGreater(row["wall_seconds"], 0)
            if row["panel"] == "disk":  # read, spilled and read again, written
                self.assertGreaterEqual(row["moved_bytes"], 2 * (40 + 34) * row["points"])
                self.assertEqual(row["floor_share"] is None, row["method"] == "floor")
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["sort.csv", "sort.json", "sort.png", "sort.svg"])

    def test_builds_are_sound_whatever_the_cap_and_leave_their_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "build", "--points", "40k", "--points", "400k", "--cap", "96M", "--cap", "256M", "--repeats", "1",
                               "--threads", "2", "-o", charts, "--json")
        rows = json.loads((charts / "build.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        methods = ["compact", "fast", "floor"]
        self.assertEqual([(r["panel"], r["method"]) for r in rows],
                         [("points", m) for m in 2 * methods] + [("cap", m) for m in 2 * methods])
        for row in rows:
            self.assertGreater(row["wall_seconds"], 0)
            self.assertGreater(row["moved_bytes"], row["input_bytes"])
            self.assertEqual(row["floor_share"] is None, row["method"] == "floor")
            if row["method"] != "floor":
                self.assertLess(row["bytes_per_point"], 12)
                self.assertLess(row["bytes_per_node"], 40)
                self.assertLess(row["resident_bytes"], row["memory_bytes"])
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["build.csv", "build.json", "build.png", "build.svg"])

    def test_caches_answer_alike_and_leave_their_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "cache", "--quick", "--points", "60k", "--receivers", "1024", "--repeats", "1", "--threads", "1",
                               "-o", charts, "--json")
        rows = json.loads((charts / "cache.json").read_text())["rows"]
        self.assertEqual(json.loads(printed.stdout)["rows"], rows)
        self.assertEqual([r["panel"] for r in rows].count("hits"), 4)
        self.assertEqual({r["panel"] for r in rows}, {"hits", "back-end", "threads", "receivers", "pages", "sizes"})
        ways = {r["method"] for r in rows if r["panel"] == "back-end"}
        self.assertTrue(ways >= {"pread", "mmap"})
        self.assertEqual({r["method"]: r["bytes"] for r in rows if r["panel"] == "back-end" and r["cap"] == 1 and r["threads"] == 1},
                         dict.fromkeys(ways, next(r["bytes"] for r in rows if r["panel"] == "back-end")))
        for row in rows:
            self.assertGreater(row["wall_seconds"], 0)
            if row["panel"] != "hits":
                self.assertGreater(row["bytes"], 0)
                self.assertEqual(row["in_core_share"] is None, row["panel"] == "threads")
            elif row["method"] != "pointers":
                self.assertGreater(row["hit_rate"], 0.99)
        for way in ways:  # less memory, more to read
            read = [r["bytes"] for r in rows if r["panel"] == "back-end" and r["method"] == way and r["threads"] == 1]
            self.assertEqual(read, sorted(read))
            self.assertGreater(read[-1], read[0])
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["cache.csv", "cache.json", "cache.png", "cache.svg"])

    def test_scale_goes_end_to_end_and_leaves_its_files_alone(self):
        charts = self.here / "charts"
        printed = self.succeed("ptcbench", "scale", "--quick", "--points", "20k", "--points", "900k", "--receivers", "300",
                               "--memory", "116M", "--threads", "2", "-o", charts, "--json")
        self.assertIn("MB of temporary files in", printed.stderr)
        facts = json.loads((charts / "scale.json").read_text())
        said = json.loads(printed.stdout)
        self.assertEqual([said["rows"], said["laws"]], [facts["rows"], facts["laws"]])
        stages = ["build", "verify", "shade", "build floor", "verify floor", "memcpy"]
        self.assertEqual([r["stage"] for r in facts["rows"]], 2 * stages)
        self.assertEqual([law["stage"] for law in facts["laws"]], stages[:3])
        for row in facts["rows"]:
            self.assertGreater(row["wall_seconds_low"], 0)
            self.assertEqual(row["hit_rate"] is None, row["stage"] != "shade")
            self.assertEqual(row["floor_share"] is None, row["stage"] not in ("build", "verify"))
            if row["memory_bytes"]:
                self.assertLess(row["resident_bytes"], 96 << 20)
        small, large = (r for r in facts["rows"] if r["stage"] == "build")
        self.assertEqual(small["spilled_bytes"], 0)
        self.assertGreaterEqual(large["spilled_bytes"], 34 * large["points"])
        self.assertTrue(all(law["predicted_seconds"] > 0 for law in facts["laws"]))
        self.assertEqual(sorted(p.name for p in charts.iterdir()), ["scale-laws.csv", "scale.csv", "scale.json", "scale.png", "scale.svg"])

    def test_results_name_the_run_and_no_path(self):
        charts, results = self.here / "charts", self.here / "results"
        scene = self.here / "box.obj"
        scene.write_text(self.mesh.read_text())
        self.succeed("ptcbench", "accuracy", scene, "--quick", "--quiet", "--checked", "10", "--repeats", "1",
                     "--reference-rays", "256", "--method", "ptcx", "--set", "points", "--points", "1k", "-o", charts,
                     "--results", results, "--name", "little")
        self.assertEqual(sorted(p.name for p in results.iterdir()),
                         ["little-box.png", "little-box.svg", "little.md", "little.png", "little.svg"])
        text = (results / "little.md").read_text()
        self.assertIn("| command | `ptcbench accuracy box.obj --quick ", text)
        self.assertIn("--results results --name little` |", text)
        self.assertIn("Fewer than 5 runs (1)", text)
        for word in (str(self.here), os.uname().nodename + " "):
            self.assertNotIn(word, text)
        rows = json.loads((charts / "little.json").read_text())["rows"]
        self.assertEqual(text.count("| points | occlusion |") + text.count("| points | bleeding |"), len(rows))

    def test_a_name_of_files_that_leads_elsewhere_is_a_usage_error(self):
        for name in ("", ".hidden", "../charts", "a/b"):
            self.fail_with(2, "ptcbench", "sort", "--quick", "-o", self.here / "o", f"--name={name}")

    def test_growth_beyond_the_disk_is_the_machines_fault(self):
        message = self.fail_with(3, "ptcbench", "growth", "--points", "40000G", "--panel", "surfels", "-o", self.here)
        self.assertIn("GB free", message)
        for command in (["build"], ["cache"], ["scale"], ["sort", "--panel", "disk"]):
            message = self.fail_with(3, "ptcbench", *command, "--points", "40000G", "-o", self.here)
            self.assertIn("GB free", message)

    def test_containers_that_were_there_stay(self):
        charts = self.here / "charts"
        charts.mkdir()
        (charts / "box.ptcx").write_text("precious")
        self.measure(self.mesh, "--method", "embree-mesh", "--set", "points", "--points", "1k")
        self.assertEqual((charts / "box.ptcx").read_text(), "precious")

    def test_scenes_that_cannot_be_read_are_named(self):
        empty, broken = self.here / "empty.obj", self.here / "broken.ply"
        empty.touch()
        broken.write_text("ply\nformat")
        charts = self.here / "charts"
        for scene, said in ((empty, "the file is empty"), (self.here, "Is a directory"),
                            (self.here / "none.obj", "No such file or directory"),
                            (self.here / "none.obj+backdrop", "No such file or directory")):
            message = self.fail_with(1, "ptcbench", "accuracy", "fractal", scene, "-o", charts)
            self.assertIn(str(scene).removesuffix("+backdrop") + ": ", message)
            self.assertIn(said, message)
        charts.mkdir()
        self.assertIn(str(broken), self.fail_with(1, "ptcbench", "accuracy", broken, "-o", charts))
        self.assertEqual(list(charts.iterdir()), [])

    def test_an_unknown_word_is_told_those_that_are_known(self):
        for word in ("fractals", "Window"):
            message = self.fail_with(1, "ptcbench", "accuracy", word, "-o", self.here / "charts")
            self.assertIn("fractal, window, city", message)

    def test_words_that_cannot_be_meant_are_usage_errors(self):
        for word in ("city+backdrop", "+backdrop", ""):
            self.assertIn(word, self.fail_with(2, "ptcbench", "accuracy", word, "-o", self.here / "charts"))

    def test_wrong_values_of_options_are_usage_errors(self):
        cases = {
            "accuracy": ["--setting=0.1,0.1", "--setting=0.1,0.1,32,0", "--setting=0.1,0.1,32,101",
                         "--setting=0.1,0.1,32,1,1", "--setting=0,0.1,32", "--setting=13,0.1,32",
                         "--setting=0.1,-0.1,32", "--setting=0.1,4,32", "--setting=0.1,0.1,33",
                         "--setting=0.1,0.1,80", "--setting=0.1,0.1,0", "--setting=nan,0.1,32", "--setting=fine",
                         "--setting=", "--method=embree", "--method=", "--set=all", "--set=", "--points=0",
                         "--checked=9", "--repeats=0", "--reference-rays=1000", "--reference-rays=8",
                         "--reference-rays=131072"],
            "growth": ["--points=0", "--points=1.5", "--points=x", "--panel=time", "--panel=", "--checked=9",
                       "--repeats=0"],
            "scale": ["--points=999", "--points=x", "--receivers=0", "--receivers=1.5", "--repeats=0",
                      "--panel=points"],
        }
        for experiment, options in cases.items():
            for option in options:
                self.fail_with(2, "ptcbench", experiment, "-o", self.here / "o", option)

    def test_a_directory_that_cannot_be_made_is_the_machines_fault(self):
        for place in (self.mesh, self.mesh / "charts"):
            message = self.fail_with(3, "ptcbench", "accuracy", self.mesh, "--quick", "-o", place)
            self.assertIn(str(self.mesh), message)


if __name__ == "__main__":
    unittest.main()
