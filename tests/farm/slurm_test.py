"""ptcfarm under Slurm: on a real cluster of four nodes, one of which dies in the middle. Skipped (77) without Slurm."""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import slurm_cluster

BIN = Path(os.environ["PTC_BIN"])

# The first part stops with half of its files written, and names its node, which will die. Others take a second more.
WRAPPER = """#!/bin/sh
if [ "$1" = part ] && mkdir {here}/victim 2>/dev/null; then
  {program} "$@" &
  sleep 0.04
  kill -STOP $! || kill -STOP $$
  echo "$SLURMD_NODENAME" >{here}/victim/new && mv {here}/victim/new {here}/victim/node
  wait
fi
sleep 1
exec {program} "$@"
"""


class Slurm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="ptc-slurm-", dir="/tmp")
        cls.addClassCleanup(cls.folder.cleanup)
        home = Path(cls.folder.name)
        home.chmod(0o755)  # its socket is for all
        (home / "cluster").mkdir()
        cls.programs = home / "programs"
        cls.programs.mkdir()
        os.environ["PATH"] = f"{cls.programs}:{BIN}:{os.environ['PATH']}"
        cls.cluster = slurm_cluster.Cluster(home / "cluster")
        cls.addClassCleanup(cls.cluster.stop)

    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="ptc slurm 100% o'", dir=self.folder.name)
        self.addCleanup(scratch.cleanup)
        self.here = Path(scratch.name)
        self.plan = self.here / "farm.json"
        self.use(f'#!/bin/sh\nexec {BIN}/ptcfarm "$@"\n')

    def use(self, script):
        """Has the jobs run a script in place of ptcfarm."""
        new = self.programs / "new"
        new.write_text(script)
        new.chmod(0o755)
        new.replace(self.programs / "ptcfarm")

    def call(self, program, *arguments, code=0):
        done = subprocess.run([BIN / program, *map(str, arguments)], env=self.cluster.environment | {"PATH": os.environ["PATH"]},
                              capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def facts(self, program, *arguments):
        return json.loads(self.call(program, *arguments, "--json"))

    def status(self):
        return self.facts("ptcfarm", "status", self.plan)

    def wait_for(self, what, condition, seconds=60):
        self.cluster.wait(what, lambda: condition(self.status()), seconds)

    def test_a_node_dies_and_the_controller_starts_again_and_the_scene_is_that_of_one_machine(self):
        self.call("ptcbuild", "--city", "800k", "-o", self.here / "one.ptcx")
        self.call("ptcfarm", "plan", "--city", "800k", "--parts", 12, "--task-memory", "256M", "-o", self.plan)
        self.use(WRAPPER.format(program=BIN / "ptcfarm", here=self.folder.name))
        jobs = self.facts("ptcfarm", "submit", self.plan, "--slurm")["jobs"]
        self.assertEqual(len(jobs), 3)
        self.assertIn(f"jobs {', '.join(jobs)} of it wait or run", self.call("ptcfarm", "submit", self.plan, "--slurm", code=1))

        # A node dies with a part half written
        victim = Path(self.folder.name) / "victim" / "node"
        self.cluster.wait("a part that stops", victim.exists)
        node = victim.read_text().strip()
        states = {(task["state"], task["slurm"]) for task in self.status()["states"] if task.get("where") == node}
        self.assertEqual(states, {("running", "RUNNING")})
        self.assertGreater(len(self.cluster.kill_node(node)), 3)  # slurmd, a step, a script, a task

        # The controller is away while no job ends, which would wait for it longer or be lost, and knows its jobs again
        self.wait_for("the other parts", lambda status: status["done"] >= 11)
        self.cluster.wait("the ends of their jobs", lambda: all(
            line.split()[-1] == node for line in self.cluster.call("squeue", "-h", "-t", "R,CG", "-o", "%i %N").splitlines()))
        self.cluster.stop_controller()
        self.assertIn("squeue", self.status()["trouble"])
        self.cluster.start_controller()
        self.wait_for("the end", lambda status: status["done"] == 14)
        status = self.status()
        self.assertEqual((status["failed"], status["share"]), (0, 1))

        # What came out is what one machine builds, and nothing is left
        scenes = [self.here / "farm.ptcx", self.here / "one.ptcx"]
        digests = [json.loads(self.call("ptcverify", scene, "--level", "4", "--json"))["tree_digest"] for scene in scenes]
        self.assertEqual(digests[0], digests[1])
        shaded = [self.here / "farm.ply", self.here / "one.ply"]
        for scene, out in zip(scenes, shaded):
            self.call("ptcshade", scene, "--count", "500", "--bounces", 0, "-o", out)
        self.assertEqual(shaded[0].read_bytes(), shaded[1].read_bytes())
        self.assertEqual([name for name in os.listdir(self.here / "farm.parts") if ".tmp-" in name], [])
        self.assertIn("all tasks are done", self.call("ptcfarm", "submit", self.plan, "--slurm"))

    def test_lit_scenes_are_shaded_and_rendered_by_a_cluster(self):
        coarse = ["--bounces", 2, "--solid-angle", 0.2, "--resolution", 16, "--parallax", 0.3]
        options = ["--turntable", 2, "--size", "32x24", "--samples", 1, *coarse]
        pictures = [shlex.quote(str(self.here / "turn.#.exr")), *map(str, options)]
        self.call("ptcfarm", "plan", "--city", "20k", "--parts", 2, "--task-memory", "256M", "--sun", "200,35", *coarse,
                  "--shade", self.here / "lit.ply", "--render", " ".join(["-o", *pictures]), "-o", self.plan)
        tasks = json.loads(self.plan.read_text())["tasks"]
        self.assertEqual({task["kind"] for task in tasks}, {"route", "part", "join", "light", "join_light", "bounce", "join_bounce",
                                                            "shade", "collect", "frame"})
        self.call("ptcfarm", "submit", self.plan, "--slurm")
        self.wait_for("the end", lambda status: status["done"] == len(tasks), 120)
        self.call("ptcshade", self.here / "farm.ptcx", *coarse, "-o", self.here / "one.ply")
        self.call("ptcrender", self.here / "farm.ptcx", *options, "-o", self.here / "one.#.exr")
        for name in ("lit.ply", "turn.1.exr", "turn.2.exr"):
            one = re.sub(r"lit|turn", "one", name)
            self.assertTrue((self.here / name).read_bytes() == (self.here / one).read_bytes(), name)
        self.assertEqual([name for name in os.listdir(self.here / "farm.parts") if name.startswith(("bounce", "unlit", "route"))], [])

    def test_failed_tasks_are_shown_with_what_they_said_and_submitted_again(self):
        cloud = self.here / "c.ptcx"
        self.call("ptcbuild", "--city", "20k", "-o", cloud)
        self.call("ptcfarm", "plan", cloud, "--parts", 2, "--task-memory", "256M", "-o", self.plan)
        cloud.rename(self.here / "away.ptcx")
        self.call("ptcfarm", "submit", self.plan, "--slurm")
        self.wait_for("failure", lambda status: status["failed"] > 0)
        text = self.call("ptcfarm", "status", self.plan)
        self.assertRegex(text, r"^\[\.{30}\] 0 %, 0 of 4 tasks done, \d failed, 0 running, \d queued")
        self.assertRegex(text, r"route\.0 failed:\n.*c\.ptcx: .*it is gone")
        self.call("ptcfarm", "cancel", self.plan)
        (self.here / "away.ptcx").rename(cloud)
        self.call("ptcfarm", "submit", self.plan, "--slurm")
        self.wait_for("the end", lambda status: status["done"] == 4)

    def test_what_the_machine_refused_is_queued_again_a_bounded_number_of_times(self):
        """As many times as the rule of ptcfarm run says; the second time the machine is better."""
        self.call("ptcfarm", "plan", "--city", "8k", "--parts", 1, "--task-memory", "256M", "-o", self.plan)
        tries = self.here / "tries"
        self.use(f'#!/bin/sh\nif [ "$1" = part ]; then echo x >>"{tries}"; [ $(wc -l <"{tries}") -gt 1 ] || {{ echo no room >&2; exit 3; }}; fi\n'
                 f'exec {BIN}/ptcfarm "$@"\n')
        self.call("ptcfarm", "submit", self.plan, "--slurm")
        self.wait_for("the end", lambda status: status["done"] == 3)
        self.assertEqual(tries.read_text(), "x\nx\n")
        self.assertIn("no room", (self.here / "farm.parts" / "log" / "part_0.0").read_text())

    def test_a_task_that_is_preempted_is_queued_again(self):
        """Slurm ends a preempted job and queues it again as scontrol does here."""
        self.call("ptcfarm", "plan", "--city", "8k", "--parts", 1, "--task-memory", "256M", "-o", self.plan)
        begun = self.here / "begun"
        self.use(f'#!/bin/sh\nif [ "$1" = part ]; then echo x >>"{begun}"; [ $(wc -l <"{begun}") -gt 1 ] || sleep 60; fi\n'
                 f'exec {BIN}/ptcfarm "$@"\n')
        jobs = self.facts("ptcfarm", "submit", self.plan, "--slurm")["jobs"]
        self.cluster.wait("a part that runs", begun.exists)
        self.cluster.call("scontrol", "requeue", jobs[1] + "_0")
        self.wait_for("the end", lambda status: status["done"] == 3)
        self.assertEqual(begun.read_text(), "x\nx\n")
        self.assertEqual(self.status()["failed"], 0)

    def test_a_job_that_takes_too_much_memory_is_shown_and_cancelled_jobs_are_gone(self):
        self.call("ptcfarm", "plan", "--city", "8k", "--parts", 3, "--task-memory", "256M", "-o", self.plan)
        big = "import time; x = bytearray(600 << 20); time.sleep(30)"
        self.use(f'#!/bin/sh\ncase $1 in\nroute) exec {BIN}/ptcfarm "$@" ;;\n'
                 f"part) [ $4 != 1 ] || exec {sys.executable} -c '{big}'; sleep 60 ;;\nesac\n")
        self.call("ptcfarm", "submit", self.plan, "--slurm")
        self.wait_for("failure", lambda status: status["failed"] == 1)
        failed = next(task for task in self.status()["states"] if task["state"] == "failed")
        self.assertEqual(failed["name"], "part.1")
        self.assertRegex(failed["error"], r"(?i)memory")
        facts = self.facts("ptcfarm", "cancel", self.plan)
        self.assertEqual((facts["done"], facts["left"]), (1, 4))
        self.assertTrue(facts["cancelled"])
        status = self.status()
        self.assertEqual((status["running"], status["queued"], status["done"]), (0, 0, 1))
        self.assertEqual(self.facts("ptcfarm", "cancel", self.plan)["cancelled"], [])


if __name__ == "__main__":
    if reason := slurm_cluster.missing():
        print(f"skipped: {reason}")
        sys.exit(77)
    unittest.main()
