"""ptcfarm: the tasks of a plan build the scene that one machine builds."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

from programs import BIN, ProgramTest, ball, run, write_ply

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "spec"))
import verifier  # noqa: E402

SBATCH = """#!/bin/sh
here=$(dirname "$0")
echo "$@" >> "$here/sbatch.log"
cat > "$here/job"
last=$(echo "$*" | sed 's/.*--array=0-\\([0-9]*\\).*/\\1/')
for task in $(seq 0 "$last"); do
  SLURM_ARRAY_TASK_ID=$task SLURM_JOB_ID=$task sh "$here/job" >&2 || exit 1
done
wc -l < "$here/sbatch.log"
"""
CHANNELS = ["x", "y", "z", "nx", "ny", "nz", "radius", "radiance_r", "radiance_g", "radiance_b", "red", "green", "blue",
            "intensity"]
# As a plan has a channel, without components
CHANNEL = {"name": "a", "type": 1, "components": 0, "group": 2, "role": 0, "colour_space": 0, "unit": "", "scale": 1, "offset": 0,
           "size": 0}
FRAMES = {"options": [], "directory": "/", "targets": ["/a.exr"], "bounces": 1, "lift": 0.15, "solid_angle": 0.05, "parallax": 0.2,
          "inflation": 1, "resolution": 16, "sides": 0}


class Farm(ProgramTest):
    def digest(self, scene):
        return json.loads(self.succeed("ptcverify", scene, "--level", "4", "--json").stdout)["tree_digest"]

    def shaded(self, scene):
        out = self.here / "shaded.ply"
        self.succeed("ptcshade", scene, "-o", out)
        return out.read_bytes()

    def plan(self, *arguments, parts=4):
        self.succeed("ptcfarm", "plan", *arguments, "--parts", parts, "-o", self.here / "farm.json", "--task-memory", "256M")
        return json.loads((self.here / "farm.json").read_text())

    def run_plan(self, *options):
        return json.loads(self.succeed("ptcfarm", "run", self.here / "farm.json", "--memory", "1G", "--json", *options).stdout)

    def check_same(self, one):
        """Compares the scene of the plan with the container of one machine."""
        scene = self.here / "farm.ptcx"
        self.assertEqual(self.digest(scene), self.digest(one))
        self.assertEqual(self.shaded(scene), self.shaded(one))
        facts = [json.loads(self.succeed("ptcinfo", path, "--json").stdout) for path in (scene, one)]
        for fact in ("points", "bounds", "channels", "text"):
            self.assertIn(fact, facts[0])
            self.assertEqual(facts[0][fact], facts[1][fact], fact)

    def test_a_city_has_the_bits_of_one_machine_in_every_profile(self):
        for profile in ("exact", "compact"):
            with self.subTest(profile):
                one = self.here / "one.ptcx"
                self.succeed("ptcbuild", "--city", "8k", "--profile", profile, "--page-size", "4K", "-o", one)
                plan = self.plan("--city", "8k", "--profile", profile, "--page-size", "4K", parts=6)
                self.assertEqual(len(plan["cuts"]), 5)
                self.assertEqual(self.run_plan()["ran"], 8)
                self.check_same(one)
                verifier.verify(str(self.here / "farm.ptcx"))

    def test_clouds_of_other_channels_and_points_at_one_place(self):
        first, second = self.here / "a.ply", self.here / "b.ply"
        write_ply(first, [(*point, i % 251) for i, point in enumerate(ball(900))], CHANNELS)
        points = ball(700, seed=3)
        write_ply(second, points + points[:300])  # which lacks the channel of the first
        for options in ([], ["--remove-duplicates", "--leaf", "2"], ["--original-order", "--every", "3"]):
            with self.subTest(options):
                one = self.here / "one.ptcx"
                self.succeed("ptcbuild", first, second, *options, "-o", one)
                self.assertEqual(len(self.plan(first, second, *options)["cuts"]), 3)
                self.run_plan()
                self.check_same(one)

    def test_discs_so_wide_that_rounding_takes_them_out_of_their_part_are_refused(self):
        wide = self.here / "wide.ply"
        write_ply(wide, [(*point[:6], 1e5, *point[7:]) for point in ball(900)])
        self.plan(wide)
        failed = run("ptcfarm", "run", self.here / "farm.json")
        self.assertEqual(failed.returncode, 1)
        self.assertIn("a disc is so wide that rounding moves its point to the part before", failed.stderr)
        self.plan(wide, "--profile", "exact")
        self.run_plan()
        one = self.here / "one.ptcx"
        self.succeed("ptcbuild", wide, "--profile", "exact", "-o", one)
        self.assertEqual(self.digest(self.here / "farm.ptcx"), self.digest(one))

    def test_a_large_scene_has_no_more_routes_than_a_scheduler_starts_soon(self):
        for points, least, most in (("100M", 24, 25), ("20G", 1990, 2010)):
            plan = self.plan("--city", points, parts=20)
            self.assertGreaterEqual(len(plan["inputs"]), least)
            self.assertLessEqual(len(plan["inputs"]), most)

    def test_a_plan_of_one_part_and_a_plan_of_more_parts_than_there_are_cuts(self):
        for parts, cuts in ((1, 0), (500, 30)):
            self.assertGreaterEqual(len(self.plan(self.cloud, parts=parts)["cuts"]), cuts)
            self.run_plan()
            self.check_same(self.scene)

    def test_each_task_is_a_command_that_can_be_run_again(self):
        plan = self.plan("--city", "30k")
        for task in plan["tasks"]:
            for again in (False, True):
                words = task["command"]
                self.assertEqual(words[0], "ptcfarm")
                facts = json.loads(self.succeed(*words, "--json").stdout)
                self.assertEqual(facts["ran"], not again)
            for output in task["outputs"]:
                self.assertTrue(Path(output).exists(), output)
        self.assertEqual(self.run_plan()["skipped"], len(plan["tasks"]))
        # A part that is lost comes back with the same bytes, and so does the scene
        part, scene = self.here / "farm.parts" / "2.ptcx", self.here / "farm.ptcx"
        before = part.read_bytes(), scene.read_bytes()
        part.unlink()
        self.assertEqual(self.run_plan()["ran"], 2)  # the route and the part
        scene.unlink()
        self.assertEqual(self.run_plan()["ran"], 1)
        self.assertEqual((part.read_bytes(), scene.read_bytes()), before)

    def test_a_task_waits_for_those_before_it(self):
        self.plan("--city", "30k")
        message = run("ptcfarm", "part", self.here / "farm.json", "--number", "1")
        self.assertEqual(message.returncode, 3)
        self.assertIn("part.1 needs route.0, which is not done", message.stderr)

    def test_a_failed_task_is_told_and_run_again(self):
        cloud = self.here / "c.ply"
        cloud.write_bytes(self.cloud.read_bytes())
        self.plan(cloud)
        whole = cloud.read_bytes()
        cloud.write_bytes(whole[:-5])
        failed = run("ptcfarm", "run", self.here / "farm.json")
        self.assertEqual(failed.returncode, 1)
        self.assertIn("route.0 failed:\n", failed.stderr)
        self.assertIn(str(cloud), failed.stderr)
        status = json.loads(self.succeed("ptcfarm", "status", self.here / "farm.json", "--json").stdout)
        self.assertEqual((status["done"], status["failed"]), (0, 1))
        self.assertIn(str(cloud), status["states"][0]["error"])
        self.assertIn(str(cloud), self.succeed("ptcfarm", "status", self.here / "farm.json").stdout)
        cloud.write_bytes(whole)
        self.plan(cloud)
        self.run_plan()
        status = self.succeed("ptcfarm", "status", self.here / "farm.json").stdout
        self.assertRegex(status, r"^\[#{30}\] 100 %, \d+ of \d+ tasks done, 0 failed")

    def test_a_killed_run_goes_on_and_leaves_no_temporary_files(self):
        one = self.here / "one.ptcx"
        self.succeed("ptcbuild", "--city", "400k", "-o", one)
        self.plan("--city", "400k")
        command = [str(BIN / "ptcfarm"), "run", str(self.here / "farm.json"), "--threads", "1"]
        child = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)
        done = self.here / "farm.parts" / "done"
        while not all((done / name).exists() for name in ("route.0", "part.0")):
            time.sleep(0.01)
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        facts = self.run_plan()
        self.assertGreaterEqual(facts["skipped"], 2)
        self.assertEqual(self.digest(self.here / "farm.ptcx"), self.digest(one))
        self.assertEqual([p.name for p in (self.here / "farm.parts").iterdir() if ".tmp-" in p.name], [])

    def start_task(self, task, *before):
        """Starts a task as a process, which `before` may start in surroundings of its own."""
        words = [*before, str(BIN / task["command"][0]), *task["command"][1:]]
        return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def end_well(self, *processes):
        for process in processes:
            _, errors = process.communicate(timeout=100)
            self.assertEqual(process.returncode, 0, errors)

    def farm_files(self):
        """The bytes of the scene and of what lies in its folder, but for marks and logs."""
        folder = self.here / "farm.parts"
        return {path.name: path.read_bytes() for path in [self.here / "farm.ptcx", *folder.iterdir()] if path.is_file()}

    def test_two_processes_of_each_task_at_once_end_well_with_the_same_bytes(self):
        self.plan("--city", "120k", parts=3)
        self.run_plan()
        alone = self.farm_files()
        surroundings = [[]]
        own_numbers = ["unshare", "--pid", "--fork"]  # each process is number 1, as on two machines
        if shutil.which("unshare") and subprocess.run([*own_numbers, "true"], capture_output=True).returncode == 0:
            surroundings.append(own_numbers)
        for before in surroundings:
            with self.subTest(before):
                shutil.rmtree(self.here / "farm.parts")
                (self.here / "farm.ptcx").unlink()
                for task in self.plan("--city", "120k", parts=3)["tasks"]:
                    self.end_well(*(self.start_task(task, *before) for _ in range(3)))
                self.assertEqual(self.farm_files(), alone)

    def test_join_removes_what_killed_tasks_left_and_nothing_of_a_task_that_runs(self):
        self.plan("--city", "30k", parts=2)
        folder = self.here / "farm.parts"
        folder.mkdir()
        ended = subprocess.Popen(["true"])
        ended.wait()
        host = re.sub("[^0-9a-zA-Z.]", "_", os.uname().nodename[:48])
        left = [f".0.ptcx.tmp-{host}-{ended.pid}-01234567-0", ".0.ptcx.tmp-elsewhere-7-01234567-1"]
        kept = [f".0.ptcx.tmp-{host}-{os.getpid()}-01234567-0", ".0.ptcx.tmp-elsewhere-7-01234567-0", ".0.ptcx.tmp-x"]
        for name in left + kept:
            (folder / name).write_text("some")
        old = time.time() - 25 * 3600
        os.utime(folder / left[1], (old, old))
        self.run_plan()
        self.assertEqual(sorted(name for name in os.listdir(folder) if ".tmp-" in name), sorted(kept))

    def export(self, scheduler, name):
        self.succeed("ptcfarm", "export", self.here / "farm.json", "--for", scheduler, "-o", self.here / name)
        return self.here / name

    def environment(self):
        return dict(os.environ, PATH=f"{self.here}:{BIN}:{os.environ['PATH']}")

    @unittest.skipUnless(shutil.which("parallel"), "GNU parallel is not installed")
    def test_gnu_parallel_runs_what_is_exported(self):
        self.plan(self.cloud, parts=3)
        script = self.export("parallel", "farm.sh")
        ran = subprocess.run(["sh", script, "--jobs", "2"], env=self.environment(), capture_output=True, text=True, timeout=200)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertEqual(self.digest(self.here / "farm.ptcx"), self.digest(self.scene))

    def test_the_script_for_slurm_submits_arrays_in_their_order(self):
        """With an sbatch that runs each array at once and writes down its options."""
        sbatch = self.here / "sbatch"
        sbatch.write_text(SBATCH)
        sbatch.chmod(0o755)
        self.plan(self.cloud, parts=3)
        script = self.export("slurm", "farm.sh")
        ran = subprocess.run(["sh", script], env=self.environment(), capture_output=True, text=True, timeout=200)
        self.assertEqual((ran.returncode, ran.stdout), (0, "1 2 3\n"), ran.stderr)
        calls = (self.here / "sbatch.log").read_text().splitlines()
        self.assertEqual([re.search(r"--array=(\S+)", call)[1] for call in calls], ["0-0", "0-2", "0-0"])
        self.assertEqual([re.search(r"--dependency=(\S+)", call + " --dependency=")[1] if "afterok" in call else ""
                          for call in calls], ["", "afterok:1", "afterok:2"])
        for call in calls:
            self.assertRegex(call, r"--requeue .*--mem=3\d\dM --time=\d+ ")
        self.assertEqual(self.digest(self.here / "farm.ptcx"), self.digest(self.scene))
        self.assertNotIn("--cpus-per-task", script.read_text())
        self.succeed("ptcfarm", "export", self.here / "farm.json", "--for", "slurm", "--threads", 4, "-o", self.here / "four.sh")
        self.assertEqual((self.here / "four.sh").read_text().count("--cpus-per-task=4"), 3)

    def test_slurm_does_not_take_a_name_as_a_pattern(self):
        self.succeed("ptcfarm", "plan", "--city", "8k", "-o", self.here / "50%j.json")
        self.succeed("ptcfarm", "export", self.here / "50%j.json", "--for", "slurm", "-o", self.here / "farm.sh")
        self.assertIn("50%%j.parts/log/route_0.%a'", (self.here / "farm.sh").read_text())

    def test_the_template_for_open_job_description_has_a_step_for_each_kind(self):
        self.plan(self.cloud, parts=3)
        job = json.loads(self.export("openjd", "job.json").read_text())
        self.assertEqual(job["specificationVersion"], "jobtemplate-2023-09")
        self.assertEqual([step["name"] for step in job["steps"]], ["route", "part", "join"])
        self.assertEqual([step.get("dependencies") for step in job["steps"]],
                         [None, [{"dependsOn": "route"}], [{"dependsOn": "part"}]])
        for step in job["steps"]:
            numbers, = step["parameterSpace"]["taskParameterDefinitions"]
            run_line = step["script"]["actions"]["onRun"]
            self.assertEqual(run_line["args"][-2:] == ["--threads", "1"], step["name"] == "part")
            for number in range(int(numbers["range"].split("-")[1]) + 1):
                words = [word.replace("{{Task.Param.Number}}", str(number)) for word in run_line["args"]]
                self.succeed(run_line["command"], *words)
        self.assertEqual(self.digest(self.here / "farm.ptcx"), self.digest(self.scene))

    def test_the_reference_of_open_job_description_takes_the_template(self):
        python = os.environ.get("PTC_OPENJD_PYTHON", sys.executable)
        if subprocess.run([python, "-c", "import openjd.model"], capture_output=True).returncode != 0:
            self.skipTest("Open Job Description is not installed: pip install openjd-model, and name the Python in PTC_OPENJD_PYTHON")
        self.plan("--city", "20k", "--sun", "200,35", "--shade", self.here / "lit.ply", "--bounces", 3, "--error", "10%", "--render",
                  f"-o {self.here}/turn.#.exr --turntable 3 --bounces 2", parts=2)
        read = ("import json, sys; from openjd import model\n"
                "template = model.decode_job_template(template=json.load(open(sys.argv[1])))\n"
                "job = model.create_job(job_template=template, job_parameter_values={})\n"
                "for step in job.steps: print(step.name, len(list(model.StepParameterSpaceIterator(space=step.parameterSpace))))")
        said = subprocess.run([python, "-c", read, self.export("openjd", "job.json")], capture_output=True, text=True)
        self.assertEqual(said.stdout.split(), "route 1 part 2 join 1 light 2 join_light 1 bounce_1 2 join_bounce_1 1 bounce_2 2 "
                         "join_bounce_2 1 tune 1 shade 1 collect 1 frame 3".split(), said.stderr)

    def test_an_export_does_not_replace_its_plan(self):
        self.plan(self.cloud, parts=1)
        for output, said in (("farm.json", "is the plan itself"), ("farm.txt", "must end in")):
            self.assertIn(said, self.fail_with(2, "ptcfarm", "export", self.here / "farm.json", "-o", self.here / output))
        self.assertIn("must end in .json", self.fail_with(2, "ptcfarm", "plan", self.cloud, "-o", self.here / "o.sh"))

    def test_a_plan_that_would_write_over_an_input_is_refused(self):
        statue, link, copy = (self.here / name for name in ("statue.ptcx", "link.ptcx", "copy.ptcx"))
        shutil.copyfile(self.scene, statue)
        link.symlink_to(statue)
        self.plan(self.cloud)
        self.run_plan()
        shutil.copyfile(self.here / "farm.ptcx", copy)
        shutil.copyfile(self.scene, self.here / "scene.json")
        (self.here / "farm.parts" / "away.ptcx").symlink_to(self.scene)  # it lies there and leads elsewhere
        before = statue.read_bytes()
        for arguments, names in ((["statue.ptcx", "-o", "statue.json"], ["statue.ptcx", "an input"]),
                                 (["statue.ptcx", "-o", "o.json", "--scene", "statue.ptcx"], ["statue.ptcx", "an input"]),
                                 (["statue.ptcx", "-o", "link.json"], ["link.ptcx", "statue.ptcx"]),
                                 (["link.ptcx", "-o", "statue.json"], ["link.ptcx", "statue.ptcx"]),
                                 (["farm.parts/0.ptcx", "-o", "farm.json"], ["farm.parts", "0.ptcx, which is an input"]),
                                 (["scene.json", "-o", "scene.json"], ["scene.json", "an input"]),
                                 (["farm.parts/away.ptcx", "-o", "farm.json"], ["farm.parts", "away.ptcx"]),
                                 (["copy.ptcx", "-o", "farm.json"], ["farm.parts", "a part of copy.ptcx"]),
                                 (["copy.ptcx", "-o", "o.json", "--scene", "farm.parts/1.ptcx"], ["a part of copy.ptcx"])):
            with self.subTest(arguments):
                message = self.fail_with(2, "ptcfarm", "plan", *arguments, cwd=self.here)
                for said in ("would be written over", *names):
                    self.assertIn(said, message)
        self.assertEqual(statue.read_bytes(), before)
        message = self.fail_with(2, "ptcfarm", "plan", self.scene, "-o", self.here / "a\nb.json")
        self.assertIn("no control characters", message)
        (self.here / "same.ptcx").symlink_to("same.json")
        message = self.fail_with(2, "ptcfarm", "plan", self.scene, "-o", "same.json", "--scene", "same.ptcx", cwd=self.here)
        self.assertIn("the scene and the plan are one file", message)

    def test_a_plan_says_neither_other_tasks_nor_what_they_run_and_write(self):
        path, kept = self.here / "farm.json", self.here / "kept"
        kept.write_text("kept")
        whole = json.dumps(self.plan("--city", "30k"))
        # Commands and files follow from the plan
        plan = json.loads(whole)
        for task in plan["tasks"]:
            task.update(command=["ptcfarm", "--version"], outputs=[str(kept)], inputs=[], after=["part.9"])
        path.write_text(json.dumps(plan))
        self.assertEqual(self.run_plan()["ran"], len(plan["tasks"]))
        self.assertEqual(kept.read_text(), "kept")
        self.assertTrue((self.here / "farm.ptcx").exists())
        # So do the tasks
        for change, said in ((lambda p: p["tasks"].pop(), "and a join"), (lambda p: p["tasks"].reverse(), "and a join"),
                             (lambda p: p["tasks"][1].update(number=7), "and a join"),
                             (lambda p: p["cuts"].pop(), "and a join"), (lambda p: p["cuts"].reverse(), "the cuts do not ascend"),
                             (lambda p: p["borders"].reverse(), "the borders do not ascend"),
                             (lambda p: p["borders"].remove(p["cuts"][0]), "a cut is no border"),
                             (lambda p: p["inputs"][0].update(taken=[True]), "number of channels"),
                             (lambda p: p["inputs"].clear(), "no inputs"),
                             (lambda p: p["inputs"][0].update(path="/a.ptcx"), "neither files nor the city"),
                             (lambda p: p["inputs"][0].update(blocks=[5, 4]), "blocks of an input do not ascend"),
                             (lambda p: p["inputs"][0].update(channels=[CHANNEL]), "no component of 1, 2, 4 or 8 bytes"),
                             (lambda p: p["request"].update(leaf_points=0), "points in a leaf"),
                             (lambda p: p["request"].update(levels_per_stream=99), "levels in a stream"),
                             (lambda p: p["request"].update(every=0), "every 0 points"),
                             (lambda p: p["frame"].update(edge=0), "no edge"),
                             (lambda p: p.update(frames=FRAMES | {"targets": ["a.exr"]}), "no absolute path"),
                             (lambda p: p.update(frames=FRAMES | {"targets": []}), "no pictures"),
                             (lambda p: p.update(frames=FRAMES | {"targets": ["/a.#.exr"], "range": [-2**63, 9, 1]}), "out of range"),
                             (lambda p: p.update(frames=FRAMES | {"targets": ["/a.#.exr"], "range": [1, 9, 0]}), "out of range"),
                             (lambda p: p.update(frames=FRAMES | {"range": [1, 9, 1]}), "no mark for the number"),
                             (lambda p: p.update(frames=FRAMES), "and a join"),
                             (lambda p: p["inputs"][0].update(first=5), "does not follow the one before"),
                             (lambda p: p["tasks"][0].update(seconds=-1), "seconds"),
                             (lambda p: p.update(scene="farm.ptcx"), "no absolute path")):
            plan = json.loads(whole)
            change(plan)
            path.write_text(json.dumps(plan))
            message = self.fail_with(1, "ptcfarm", "run", path)
            self.assertIn(str(path), message)
            self.assertIn(said, message)
        # The city is laid out by routes alone
        plan = json.loads(whole)
        plan["inputs"][0].update(blocks=[0, 10**9])
        path.write_text(json.dumps(plan))
        message = self.fail_with(1, "ptcfarm", "route", path, "--number", "0")
        self.assertIn("blocks that the city lacks", message)

    def test_an_input_that_got_other_channels_is_refused(self):
        cloud = self.here / "c.ply"
        write_ply(cloud, [(*point, 7) for point in ball(900)], CHANNELS)
        self.plan(cloud)
        write_ply(cloud, ball(900))
        message = run("ptcfarm", "route", self.here / "farm.json")
        self.assertEqual(message.returncode, 1)
        self.assertIn(f"{cloud}: the file changed since it was planned: ", message.stderr)

    def test_an_input_that_was_changed_in_place_is_refused(self):
        """Each change leaves the number of points and their channels as they were."""
        cloud, scene, parts = self.here / "c.ply", self.here / "s.ptcx", self.here / "p.ptcx"
        points = ball(3000)
        write_ply(cloud, points)
        self.succeed("ptcbuild", cloud, "-o", scene)
        self.succeed("ptcfarm", "plan", cloud, "--parts", 2, "-o", self.here / "p.json")
        self.succeed("ptcfarm", "run", self.here / "p.json")

        def relight():
            lit = self.here / "lit.ptcx"
            self.succeed("ptcbuild", cloud, "--sun", "0,1,0", "-o", lit)
            lit.replace(scene)

        def write_later():
            cloud.write_bytes(cloud.read_bytes())

        def change(offset):
            whole, times = bytearray(cloud.read_bytes()), cloud.stat()
            whole[offset] ^= 1
            cloud.write_bytes(whole)
            os.utime(cloud, ns=(times.st_atime_ns, times.st_mtime_ns))

        def change_part():
            self.succeed("ptcbuild", cloud, "--profile", "exact", "-o", self.here / "p.parts" / "0.ptcx")

        for source, named, act, said in ((scene, scene, relight, "its content is another one"),
                                         (cloud, cloud, lambda: change(2000), "its content is another one"),
                                         (cloud, cloud, lambda: change(-4), "its content is another one"),
                                         (cloud, cloud, write_later, "it was written since"),
                                         (parts, self.here / "p.parts" / "0.ptcx", change_part, "bytes and has")):
            with self.subTest(source=source, said=said):
                before = self.plan(source)
                same = source.read_bytes()
                if source.suffix == ".ptcx":  # a copy of the same bytes is the same
                    source.unlink()
                    source.write_bytes(same)
                    self.succeed("ptcfarm", "route", self.here / "farm.json")
                    shutil.rmtree(self.here / "farm.parts")
                act()
                message = run("ptcfarm", "route", self.here / "farm.json")
                self.assertEqual(message.returncode, 1, message.stderr)
                self.assertIn(f"{named}: the file changed since it was planned: ", message.stderr)
                self.assertIn(said, message.stderr)
                self.assertIn("plan again", message.stderr)
                self.assertFalse((self.here / "farm.parts" / "route.0").exists())
                if source != parts:  # a plan of the new file is another plan
                    self.assertNotEqual(self.plan(source)["files"], before["files"])

    def test_other_or_damaged_plans_are_refused(self):
        path = self.here / "farm.json"
        self.plan("--city", "30k")
        text = path.read_text()
        for changed in ("", "{}", "[1]", text[:-100], text.replace("ptcfarm plan 4", "ptcfarm plan 3"),
                        text.replace('"kind": "join"', '"kind": "frob"'), text.replace('"points"', '"dots"')):
            path.write_text(changed)
            result = run("ptcfarm", "status", path)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn(str(path), result.stderr)
        # Another plan of the same name begins anew
        path.write_text(text)
        self.run_plan()
        self.plan("--city", "30k", parts=3)
        self.assertEqual(self.run_plan()["skipped"], 0)

    def test_what_needs_one_machine_is_refused(self):
        bare = self.here / "bare.xyz"
        bare.write_text("".join(f"{x} {y} {x * y % 3}\n" for x in range(20) for y in range(20)))
        for arguments, said in (([self.mesh], "build the meshes to a container first"), ([bare], "normals and radii"),
                                (["-"], "standard input"), ([self.scene, "--city", "5k"], "excludes"), ([], "--city")):
            message = self.fail_with(2, "ptcfarm", "plan", *arguments, "-o", self.here / "o.json")
            self.assertIn(said, message)
        self.assertIn("--output is required", self.fail_with(2, "ptcfarm", "plan", self.scene))
        self.assertIn("takes one plan", self.fail_with(2, "ptcfarm", "run"))
        self.assertIn("needs a value", self.fail_with(2, "ptcfarm", "plan", self.scene, "-o"))

    def children(self, pid):
        return [int(name) for name in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def begin_run(self, *options):
        """Starts a run and waits until a task of it runs. Returns both."""
        process = subprocess.Popen([BIN / "ptcfarm", "run", self.here / "farm.json", *options], text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(process.kill)
        while not (running := self.children(process.pid)):
            self.assertIsNone(process.poll())
        return process, running[0]

    def test_a_task_that_a_signal_ends_is_run_again_a_bounded_number_of_times(self):
        self.plan("--city", "400k", parts=2)
        process, task = self.begin_run("--json", "--threads", "1")
        os.kill(task, signal.SIGKILL)
        output, errors = process.communicate(timeout=100)
        facts = json.loads(output)
        self.assertEqual((process.returncode, facts["retried"], facts["failed"]), (0, 1, []), errors)
        # What the system refuses each time: a folder has the name of a part
        self.plan("--city", "30k", parts=1)
        (self.here / "farm.parts" / "0.ptcx").unlink()
        (self.here / "farm.parts" / "0.ptcx").mkdir()
        failed = run("ptcfarm", "run", self.here / "farm.json", "--json")
        self.assertEqual(failed.returncode, 3, failed.stderr)
        self.assertEqual(json.loads(failed.stdout)["retried"], 2)
        # Bad input is the same each time
        self.plan(self.cloud)
        (self.here / "farm.parts" / "route.0").write_bytes(b"none")
        (self.here / "farm.parts" / "done" / "route.0").write_bytes(b"none")
        failed = run("ptcfarm", "run", self.here / "farm.json", "--json")
        self.assertEqual(failed.returncode, 1, failed.stderr)

    def test_slurm_and_a_run_agree_on_what_is_worth_another_try(self):
        self.plan("--city", "8k", parts=1)
        script = self.export("slurm", "farm.sh").read_text()
        condition, = set(re.findall(r"if \{ (.*); \} && \[ .*RESTART_COUNT:-0\}\" -lt 2 \]", script))
        loop = f"for code in $(seq 0 255); do if {condition}; then echo $code; fi; done"
        codes = subprocess.run(["sh", "-c", loop], capture_output=True, text=True).stdout.split()
        self.assertEqual([int(code) for code in codes], [3, *sorted(set(range(129, 256)) - {129, 130, 131, 143})])

    def test_tasks_end_with_the_run_that_is_killed(self):
        self.plan("--city", "2M", parts=1)
        process, task = self.begin_run("--threads", "1")
        process.kill()
        process.communicate()
        end = time.time() + 10
        while Path(f"/proc/{task}").exists() and "Z" not in Path(f"/proc/{task}/stat").read_text().split()[2]:
            self.assertLess(time.time(), end, "the task goes on")
            time.sleep(0.01)
        self.assertFalse((self.here / "farm.parts" / "done" / "route.0").exists(), "the task came to its end")
        self.assertEqual([name for name in os.listdir(self.here / "farm.parts") if ".tmp-" in name], [])

    def test_a_cap_that_no_task_can_run_under_is_refused_by_the_plan(self):
        least = "16M"
        for kind in ("a route", "a part"):
            message = self.fail_with(5, "ptcfarm", "plan", "--city", "30k", "-o", self.here / "farm.json", "--task-memory", least)
            self.assertIn(f"the memory cap is too small for {kind} of this plan", message)
            least = re.search(r"the least that works is (\d+M)", message)[1]
        self.succeed("ptcfarm", "plan", "--city", "30k", "-o", self.here / "farm.json", "--task-memory", least)
        self.succeed("ptcfarm", "run", self.here / "farm.json", "--memory", least, "--threads", "64")

    COARSE = ["--solid-angle", "0.2", "--resolution", "16", "--parallax", "0.3"]

    def check_shaded(self, plan, shade):
        """Runs a plan that shades, and compares the points with those of one machine."""
        lit, one = self.here / "lit.ply", self.here / "one.ply"
        facts = self.plan(*plan, "--shade", lit, *shade)
        self.run_plan()
        self.succeed("ptcshade", self.here / "farm.ptcx", "-o", one, *shade[2:], "--threads", "1")
        self.assertTrue(lit.read_bytes() == one.read_bytes(), shade)
        folder = self.here / "farm.parts"
        left = {path.name for path in folder.iterdir() if path.is_file()}
        self.assertLessEqual(left, {"tune", *(f"{i}.ptcx{end}" for i in range(4) for end in ("", ".edges"))})
        self.assertEqual(self.run_plan()["ran"], 0)
        return facts

    def test_shaded_ranges_are_collected_with_the_bits_of_one_machine(self):
        for points, shade, ranges in (("140k", ["--ranges", 3, "--bounces", 0, *self.COARSE], 3),
                                      ("20k", ["--ranges", 5, "--lift", "0.3", "--sides", "front"], 5),  # four without points
                                      ("90k", ["--ranges", 2, "--count", "70k", "--distance", "3", "--falloff", 2, *self.COARSE], 2)):
            with self.subTest(shade):
                plan = self.check_shaded(["--city", points], shade)
                self.assertEqual([task["name"] for task in plan["tasks"][5:]],
                                 ["join"] + [f"shade.{i}" for i in range(ranges)] + ["collect"])

    def test_there_is_a_range_for_each_million_points_that_are_shaded(self):
        for count, ranges in ((["--count", "2M"], 2), ([], 20)):
            plan = self.plan("--city", "20M", "--shade", self.here / "lit.ply", *count)
            self.assertEqual(sum(task["kind"] == "shade" for task in plan["tasks"]), ranges)

    def test_shaded_clouds_keep_their_channels(self):
        cloud = self.here / "a.ply"
        write_ply(cloud, [(*point, i % 251) for i, point in enumerate(ball(900))], CHANNELS)
        self.check_shaded([cloud], ["--ranges", 1, "--colour-from", "occlusion"])

    def test_every_bounce_is_a_wave_of_tasks_with_the_bits_of_one_machine(self):
        """Parts of the points are lit in batches of 65,536, which go across the ends of the parts."""
        self.check_shaded(["--city", "80k"], ["--ranges", 2, "--bounces", 3, *self.COARSE])
        done = {path.name for path in (self.here / "farm.parts" / "done").iterdir()}
        self.assertLess({"bounce_1.3", "join_bounce_1", "bounce_2.0", "join_bounce_2", "shade.1"}, done)

    def test_the_settings_that_meet_an_error_are_chosen_by_a_task(self):
        self.check_shaded(["--city", "80k"], ["--ranges", 2, "--count", "70k", "--bounces", 2, "--error", "20%"])
        for action in ("run", "status"):
            tuning = json.loads(self.succeed("ptcfarm", action, self.here / "farm.json", "--json").stdout)["tuning"]
            self.assertTrue(tuning["met"])
            self.assertEqual(tuning["asked"], 0.2)
            self.assertLess(0, tuning["measured"]["occlusion_rms"])
            self.assertIn("20 % asked, ", self.succeed("ptcfarm", action, self.here / "farm.json").stdout)
        # A finished plan needs the settings no more
        settings = self.here / "farm.parts" / "tune"
        whole = bytearray(settings.read_bytes())
        settings.unlink()
        self.assertEqual(self.run_plan()["ran"], 0)
        whole[40] ^= 1
        settings.write_bytes(whole)
        self.assertIn("the state's checksum is wrong", self.succeed("ptcfarm", "status", self.here / "farm.json").stdout)
        (self.here / "lit.ply").unlink()
        failed = run("ptcfarm", "run", self.here / "farm.json")
        self.assertEqual(failed.returncode, 1)
        self.assertIn(f"{settings}: the state's checksum is wrong", failed.stderr)
        self.assertIn("combined with --error", self.fail_with(2, "ptcfarm", "plan", self.cloud, "--shade", self.here / "lit.ply", "--error", "5%",
                                                         "--solid-angle", 0.1, "-o", self.here / "o.json"))

    def check_lit(self, cloud, lights, *options):
        """Compares the scene of a plan with lights with what ptclight makes of one machine's container."""
        one, lit = self.here / "one.ptcx", self.here / "lit.ptcx"
        self.succeed("ptcbuild", *cloud, *options, "-o", one)
        self.succeed("ptclight", one, *lights, "-o", lit)
        self.plan(*cloud, *options, *lights)
        self.run_plan()
        self.check_same(lit)
        verifier.verify(str(self.here / "farm.ptcx"))
        names = {path.name for path in (self.here / "farm.parts").iterdir() if path.is_file()}
        self.assertEqual(names, {f"{i}.ptcx{end}" for i in range(4) for end in ("", ".edges")})
        self.assertNotEqual(self.digest(lit), self.digest(one))

    def test_points_are_lit_with_the_bits_of_one_machine(self):
        channels = [*CHANNELS, "emission_r", "emission_g", "emission_b"]
        emitting, plain = self.here / "emitting.ply", self.here / "plain.ply"
        write_ply(emitting, [(*point, i % 251, *(3 * [9.0 if i % 50 == 0 else 0.0])) for i, point in enumerate(ball(2000))], channels)
        write_ply(plain, [(*point, i % 251) for i, point in enumerate(ball(2000))], CHANNELS)
        for cloud, lights, options in (([plain], ["--sun", "200,35", "--sky", "0.3,0.4,0.6"], ["--profile", "exact"]),
                                       ([emitting], ["--point", "0,3,0,60W", "--light-group", "lamp", "--spot", "2,2,0,-1,-1,0,40,0.2,300cd"], []),
                                       ([emitting], ["--sky", "0,0,0", "--area-rays", 4], ["--original-order"]),
                                       (["--city", "80k"], ["--sun", "200,35"], [])):
            with self.subTest(lights=lights):
                self.check_lit(cloud, lights, *options)

    def test_a_scene_is_lit_and_shaded_in_waves_and_a_lost_part_comes_back(self):
        lights = ["--sun", "120,50", "--sky", "0.2"]
        self.check_shaded([self.cloud, *lights], ["--ranges", 1, "--bounces", 2])
        scene, part = self.here / "farm.ptcx", self.here / "farm.parts" / "1.ptcx"
        before = scene.read_bytes(), part.read_bytes()
        scene.unlink()
        self.assertEqual(self.run_plan()["ran"], 1)
        part.unlink()
        self.run_plan()
        self.assertEqual((scene.read_bytes(), part.read_bytes()), before)
        names = {path.name for path in part.parent.iterdir() if path.is_file()}
        self.assertEqual(names, {f"{i}.ptcx{end}" for i in range(4) for end in ("", ".edges")})

    def test_plans_that_take_turns_under_one_name_do_not_take_each_others_files_for_theirs(self):
        lit = [self.cloud, "--sun", "120,50", "--sky", "0.2"]
        digests = []
        for plan in (lit, [self.cloud], lit, [self.cloud]):
            self.plan(*plan)
            self.run_plan()
            digests.append(self.digest(self.here / "farm.ptcx"))
        self.assertEqual(digests[:2], digests[2:])
        self.assertNotEqual(digests[0], digests[1])
        # A task that was killed when its file was there and its mark was not leaves no mark of the other plan
        mark = self.here / "farm.parts" / "done" / "part.1"
        before = mark.read_bytes()
        self.plan(*lit)
        part = self.here / "farm.parts" / "1.ptcx"
        part.unlink()
        part.mkdir()  # so that the task fails
        self.assertEqual(run("ptcfarm", "run", self.here / "farm.json").returncode, 3)
        self.assertNotEqual(before, b"")
        self.assertFalse(mark.exists())

    def test_a_part_that_is_lost_before_what_comes_behind_it_is_built_first(self):
        plan = self.plan(self.cloud, "--shade", self.here / "lit.ply", "--ranges", 1, *self.COARSE)
        for task in plan["tasks"][:6]:
            self.succeed(*task["command"])
        (self.here / "farm.parts" / "2.ptcx").unlink()
        facts = self.run_plan()
        self.assertEqual((facts["ran"], facts["retried"]), (4, 0))

    def test_light_waits_for_the_scene_and_takes_no_other_picture_of_the_sky(self):
        sky = self.here / "sky.hdr"
        head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n"
        sky.write_bytes(head + bytes((90, 120, 200, 128)) * 8)
        plan = self.plan(self.cloud, "--sky", sky)
        self.assertIn("light.0 needs join", self.fail_with(3, "ptcfarm", "light", self.here / "farm.json", "--number", 0))
        sky.write_bytes(head + bytes((90, 120, 201, 128)) * 8)
        message = run("ptcfarm", "run", self.here / "farm.json")
        self.assertEqual(message.returncode, 1)
        self.assertIn(f"{sky}: the picture changed since it was planned: plan again", message.stderr)
        self.assertFalse((self.here / "farm.ptcx").exists())
        self.assertEqual(plan["lighting"]["rig"]["sky"]["map"], str(sky))
        self.assertIn("--sun-rays requires a light", self.fail_with(2, "ptcfarm", "plan", self.cloud, "--sun-rays", 2, "-o", self.here / "o.json"))

    def test_ranges_get_files_of_their_own_that_together_are_the_file_of_one_machine(self):
        one, cloud = self.here / "one.ply", self.here / "a.ply"
        points = [(*point, i % 251) for i, point in enumerate(ball(70000))]
        write_ply(cloud, points, CHANNELS)
        for folder in ("lit", "las"):
            (self.here / folder).mkdir()
        self.plan(cloud, "--shade", self.here / "lit" / "x.###.ply", "--ranges", 4, "--bounces", 2, *self.COARSE)
        self.run_plan()
        self.succeed("ptcshade", self.here / "farm.ptcx", "-o", one, "--bounces", 2, *self.COARSE)
        names = ["x.001.ply", "x.003.ply"]  # two batches: the other ranges have no points
        self.assertEqual(sorted(path.name for path in (self.here / "lit").iterdir()), names)
        body = lambda path: path.read_bytes().split(b"end_header\n", 1)[1]
        self.assertTrue(b"".join(body(self.here / "lit" / name) for name in names) == body(one))
        folder = self.here / "farm.parts"
        self.assertEqual([path.name for path in folder.iterdir() if path.name.startswith(("bounce", "shade"))], [])
        # A range without points has no file, also where an earlier plan has left one
        (self.here / "lit" / "x.000.ply").write_bytes(b"old")
        (folder / "done" / "shade.0").unlink()
        self.run_plan()
        self.assertFalse((self.here / "lit" / "x.000.ply").exists())
        # A lost file is shaded anew; without the bounces, these come back first
        lost = self.here / "lit" / names[0]
        before = lost.read_bytes()
        lost.unlink()
        self.run_plan()
        self.assertEqual(lost.read_bytes(), before)
        self.assertEqual([path.name for path in folder.iterdir() if path.name.startswith(("bounce", "shade"))], [])
        self.assertEqual(self.run_plan()["ran"], 0)
        # As tiles they are what one file is
        self.succeed("ptcconvert", one, self.here / "one.las")
        self.plan(cloud, "--shade", self.here / "las" / "#.las", "--ranges", 2, "--bounces", 0, *self.COARSE)
        self.run_plan()
        facts = [json.loads(self.succeed("ptcbuild", path, "-o", self.here / "o.ptcx", "--json").stdout)["points"]
                 for path in (self.here / "las", self.here / "one.las")]
        self.assertEqual(facts, [70000, 70000])
        message = self.fail_with(2, "ptcfarm", "plan", self.here / "lit" / names[0], "-o", self.here / "farm.json",
                                 "--shade", self.here / "lit" / "x.###.ply")
        self.assertIn("is an input", message)

    def test_damaged_or_foreign_results_of_ranges_are_refused(self):
        lit = self.here / "lit.ply"
        plan = self.plan("--city", "8k", "--shade", lit, "--ranges", 2, *self.COARSE)
        *before, collect = plan["tasks"]
        for task in before:
            self.succeed(*task["command"])
        results = self.here / "farm.parts" / "shade.1"
        whole = results.read_bytes()
        self.assertEqual(len(whole), 40 + 8 + 40 * json.loads(self.succeed("ptcinfo", self.here / "farm.ptcx", "--json").stdout)["points"])

        def flipped(at):
            changed = bytearray(whole)
            changed[at] ^= 1
            return bytes(changed)

        for changed, said in ((flipped(3), "another run"), (flipped(9), "another run"), (flipped(17), "another run"),
                              (flipped(25), "another run"), (flipped(33), "another run"), (flipped(41), "damaged"),
                              (flipped(-1), "damaged"), (whole[:-1], "another length"), (whole + b"x", "another length"),
                              (whole[:30], "shorter"), ((results.parent / "shade.0").read_bytes(), "another run")):
            results.write_bytes(changed)
            message = run(*collect["command"])
            self.assertEqual(message.returncode, 1, message.stderr)
            self.assertIn(f"{results}: ", message.stderr)
            self.assertIn(said, message.stderr)
            self.assertFalse(lit.exists())
        results.write_bytes(whole)
        self.succeed(*collect["command"])
        self.assertTrue(lit.exists())
        # Lost points are shaded anew
        lit.unlink()
        self.assertEqual(self.run_plan()["ran"], 3)

    def test_what_a_farm_does_not_shade_is_refused(self):
        plan = ["ptcfarm", "plan", "--city", "8k", "-o", self.here / "farm.json"]
        self.assertIn("must end in", self.fail_with(2, *plan, "--shade", self.here / "lit.ptcx"))
        self.assertIn("--bounces", self.fail_with(2, *plan, "--shade", self.here / "lit.ply", "--bounces", 1001))
        self.assertIn("--shade", self.fail_with(2, *plan, "--bounces", 0))
        self.assertIn("is an input", self.fail_with(2, "ptcfarm", "plan", self.cloud, "-o", self.here / "farm.json",
                                                    "--shade", self.cloud))
        path = self.here / "farm.json"
        whole = json.dumps(self.plan("--city", "8k", "--shade", self.here / "lit.ply", "--ranges", 2))
        for change, said in ((dict(bounces=2), "those that light and shade"), (dict(bounces=1001), "bounces"), (dict(ranges=0), "ranges to shade is out of range"),
                             (dict(target="lit.ply"), "no absolute path"), (dict(target="/lit.ptcx"), "file of points"),
                             (dict(solid_angle=-1), "solid_angle"), (dict(sides=2), "no such sides"),
                             (dict(ranges=3), "those that light and shade")):
            changed = json.loads(whole)
            changed["shading"].update(change)
            path.write_text(json.dumps(changed))
            message = self.fail_with(1, "ptcfarm", "run", path)
            self.assertIn(str(path), message)
            self.assertIn(said.replace("solid_angle", "solid"), message)

    def test_pictures_are_rendered_frame_by_frame(self):
        options = "--size 32x24 --samples 1 --bounces 0 --turntable 3"
        plan = ["ptcfarm", "plan", self.cloud, "--parts", 2, "-o", "farm.json", "--render"]
        (self.here / "a b").mkdir()
        self.succeed(*plan, f"-o 'a b'/c.##.exr --frames 2-3 {options} --layer occlusion=o.##.png --exposure 0", cwd=self.here)
        tasks = json.loads((self.here / "farm.json").read_text())["tasks"]
        self.assertEqual([task["name"] for task in tasks[-3:]], ["join", "frame.0", "frame.1"])
        self.run_plan()
        for frame in (2, 3):
            files = [self.here / "a b" / f"c.{frame:02}.exr", self.here / f"o.{frame:02}.png"]
            self.assertEqual(sorted(tasks[frame - 4]["outputs"]), sorted(map(str, files)))
            self.succeed("ptcrender", self.here / "farm.ptcx", "-o", self.here / "one.#.exr", *options.split(), "--frames", frame)
            self.assertTrue(files[0].read_bytes() == (self.here / f"one.{frame}.exr").read_bytes())
        self.assertEqual(len(list((self.here / "a b").iterdir())), 2)
        for lost in files:
            lost.unlink()
            self.assertEqual(self.run_plan()["ran"], 1)
            self.assertTrue(lost.exists())
        # One picture; and one that fails says why
        self.succeed(*plan, "-o one.png --size 32x24", cwd=self.here)
        self.assertEqual(self.run_plan()["ran"], 5)
        self.succeed(*plan, "-o 'a b/one.png' --size 32x24", cwd=self.here)
        shutil.rmtree(self.here / "a b")
        failed = run("ptcfarm", "run", self.here / "farm.json")
        self.assertEqual(failed.returncode, 3)
        self.assertRegex(failed.stderr, "frame.0 failed:\nptcfarm: open a b/.*one.png.*: No such file")
        status = self.succeed("ptcfarm", "status", self.here / "farm.json").stdout
        self.assertIn("No such file", status)
        for words, said in (("-o a.##.exr --frob", "--frob"), ("-o a.exr --turntable 3", "mark for the number"), ("--size 3x4", "--output"),
                            ("-o a.##.png --turntable 3", "give --exposure"), ("-o a.exr --memory 1G", "--memory"),
                            ("-o gone/a.exr", "no such folder"), (f"{self.scene} -o a.exr", "name no other one"), ("-o a.exr --", "name no other one"),
                            ("-o 'a.exr", "words of a shell"), ("-o a.exr; true", "words of a shell"), ("-o $(true).exr", "words of a shell"),
                            ("-o a.exr --light-groups", "a scene in one file"),
                            ("-o a.exr --tolerate-damage --bounces 2", "need every point"), ("-o a.#.exr --frames 1-9x0", "frames"), ("-o a.#.exr --frames 2-1", "frames"), ("--help", "--render")):
            with self.subTest(words):
                self.assertIn(said, self.fail_with(2, *plan, words, cwd=self.here))
        path = self.here / "farm.json"
        changed = json.loads(path.read_text())
        changed["frames"]["options"].append("--help")
        path.write_text(json.dumps(changed))
        self.assertEqual(run("ptcfarm", "run", path).returncode, 1)

    def test_bounces_of_pictures_are_waves_of_tasks(self):
        coarse = " ".join(map(str, self.COARSE))
        options = f"-o p.##.exr --frames 1-2 --size 32x24 --samples 1 --turntable 3 --bounces 3 {coarse}"

        def bounces():
            return [path.name for path in (self.here / "farm.parts").iterdir() if path.name.startswith("bounce")]

        def check(waves, *shade):
            tasks = self.plan("--city", "20k", *shade, "--render", options, parts=2)["tasks"]
            self.assertEqual(sum(task["name"].startswith("join_bounce") for task in tasks), waves)
            self.run_plan()
            self.assertEqual(bounces(), [])
            for name in pictures:
                self.assertTrue((self.here / name).read_bytes() == (self.here / f"one.{name}").read_bytes(), (name, shade))

        # Without shading; a lost picture needs the bounces once more
        home = os.getcwd()
        os.chdir(self.here)
        self.addCleanup(os.chdir, home)
        self.succeed("ptcbuild", "--city", "20k", "-o", "one.ptcx")
        self.succeed("ptcrender", "one.ptcx", *options.replace("p.##", "one.p.##").split())
        pictures = ["p.01.exr", "p.02.exr"]
        check(2)
        (self.here / pictures[0]).unlink()
        self.assertEqual(self.run_plan()["ran"], 2 * 3 + 1)
        self.assertEqual(bounces(), [])
        # Beside shading with the same settings, and with others, whose bounces are not those of the pictures
        self.succeed("ptcshade", "one.ptcx", "-o", "one.ply", "--bounces", 2, *self.COARSE)
        check(2, "--shade", "lit.ply", "--bounces", 2, *self.COARSE)
        self.assertTrue((self.here / "lit.ply").read_bytes() == (self.here / "one.ply").read_bytes())
        check(1, "--shade", "lit.ply", "--bounces", 2, *self.COARSE, "--lift", 0.3)
        # A picture reads the bounces of the tasks, as many as it has
        plan = self.plan("--city", "20k", "--render", options, parts=2)
        for task in plan["tasks"][:-2]:
            self.succeed(*task["command"])
        for name, code in (("bounce_2.ptcx", 1), ("bounce_1.ptcx", 0)):
            path = self.here / "farm.parts" / name
            kept = path.read_bytes()
            path.write_bytes(kept[:100])
            failed = run(*plan["tasks"][-2]["command"])
            self.assertEqual(failed.returncode, code, failed.stderr)
            path.write_bytes(kept)
        # The last one removes them; so does one that is done, when the one that did it was killed before
        self.succeed(*plan["tasks"][-1]["command"])
        self.assertEqual(bounces(), [])
        for command in (plan["tasks"][-1]["command"], ["ptcfarm", "run", "farm.json"]):
            (self.here / "farm.parts" / "bounce_1.ptcx").write_bytes(b"")
            self.succeed(*command)
            self.assertEqual(bounces(), [])
        plan["frames"]["bounces"] = 2
        plan["tasks"] = [task for task in plan["tasks"] if task["wave"] != 2]
        (self.here / "farm.json").write_text(json.dumps(plan))
        self.assertIn("other bounces than it says", run("ptcfarm", "run", "farm.json").stderr)

    def test_a_cap_below_that_of_a_task_is_refused(self):
        self.plan("--city", "30k")
        self.assertIn("268435456", self.fail_with(5, "ptcfarm", "run", self.here / "farm.json", "--memory", "100M"))


if __name__ == "__main__":
    unittest.main()
