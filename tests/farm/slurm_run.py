"""A city planned, built, lit and shaded by a real cluster of Slurm on this machine, one node of which dies in the middle.

  python3 tests/farm/slurm_run.py build/release/bin FOLDER --output spec/results/farm-slurm.md

The same is then done by one process each of ptcbuild, ptclight and ptcshade, and compared: the digest of the tree and the file of
shaded points. Needs root, Debian's slurm-wlm, and for 200 million points 25 GB of disk in FOLDER.
"""

import argparse
import filecmp
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import slurm_cluster

LIGHTS = ["--sun", "200,35"]
NODES = 4


def amount(text):
    return int(float(text[:-1]) * {"k": 1e3, "M": 1e6, "G": 1e9}[text[-1]]) if text[-1] in "kMG" else int(text)


def mebibytes(path):
    return sum(file.stat().st_size for file in ([path] if path.is_file() else path.rglob("*")) if file.is_file()) / 2**20


class Run:
    def __init__(self, arguments):
        self.arguments, self.bin, self.here = arguments, arguments.bin.resolve(), arguments.folder.resolve()
        self.here.mkdir(parents=True, exist_ok=True)
        self.shade = ["--count", arguments.count, "--bounces", arguments.bounces, *(["--error", arguments.error] if arguments.error else [])]
        self.plan, self.rows, self.notes = self.here / "farm.json", [], []

    def call(self, program, *words):
        done = subprocess.run([self.bin / program, *map(str, words)], capture_output=True, text=True, env=self.environment)
        if done.returncode != 0:
            raise RuntimeError(f"{program} {words}: {done.stdout}{done.stderr}")
        return done.stdout

    def timed(self, name, program, *words):
        """Runs a program on this machine alone, and notes its time."""
        wall, before = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN)
        output = self.call(program, *words)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        self.rows.append((name, f"`{program}`", "1", f"{time.time() - wall:.0f}", f"{cpu:.0f}"))
        return output

    def status(self):
        return json.loads(self.call("ptcfarm", "status", self.plan, "--json"))

    def farm(self):
        """Runs the plan on a cluster, and kills a node when a third of the parts are lit."""
        self.call("ptcfarm", "plan", "--city", self.arguments.points, "--task-memory", self.arguments.task_memory, *LIGHTS, "--shade", self.here / "farm.ply",
                  *self.shade, "--ranges", 16, "-o", self.plan)
        tasks = json.loads(self.plan.read_text())["tasks"]
        begun = time.time()
        jobs = json.loads(self.call("ptcfarm", "submit", self.plan, "--slurm", "--json"))["jobs"]
        lights, killed = sum(task["kind"] == "light" for task in tasks), None
        while (status := self.status())["done"] < len(tasks):
            if status["failed"]:
                raise RuntimeError(self.call("ptcfarm", "status", self.plan))
            states = [task for task in status["states"] if task["name"].startswith("light.")]
            running = [task["where"] for task in states if task["state"] == "running" and task.get("where")]
            if not killed and running and sum(task["state"] == "done" for task in states) * 3 >= lights:
                killed = running[0]
                victims = self.cluster.kill_node(killed)
                self.notes.append(f"Node {killed} was killed {time.time() - begun:.0f} s after the start with {running.count(killed)} "
                                  f"{'task' if running.count(killed) == 1 else 'tasks'} on it ({len(victims)} processes), when {sum(t['state'] == 'done' for t in states)} of {lights} parts were lit.")
            time.sleep(1)
        self.steps(tasks, begun)
        if tuning := self.status().get("tuning"):
            self.notes.append(f"An error of {self.arguments.error} was asked for; {100 * tuning['low']:.2f} to {100 * tuning['high']:.2f} % were "
                              "measured at the pilots of the task `tune`.")
        self.notes.append(f"{len(tasks)} tasks, {len(jobs)} arrays of jobs. The scene takes {mebibytes(self.here / 'farm.parts'):.0f} MiB.")

    def steps(self, tasks, begun):
        """Notes the wall time of each step: until its last mark, from the last mark of the one before."""
        done, last = self.here / "farm.parts" / "done", begun
        names = {"part": "unlit.{number}", "join": "unlit", "light": "part.{number}", "join_light": "join"}
        steps = {}
        for task in tasks:
            steps.setdefault(task["name"].split(".")[0], []).append(task)
        for step, of in steps.items():
            ends = [(done / names.get(task["kind"], "{name}").format(**task)).stat().st_mtime for task in of]
            self.rows.append((step, "`ptcfarm`", len(of), f"{max(ends) - last:.0f}", ""))
            last = max(ends)
        self.rows.append(("all of these", "Slurm, 4 nodes", len(tasks), f"{last - begun:.0f}", ""))

    def alone(self):
        scene, lit = self.here / "one.ptcx", self.here / "lit.ptcx"
        self.timed("build", "ptcbuild", "--city", self.arguments.points, "-o", scene)
        self.timed("light", "ptclight", scene, *LIGHTS, "-o", lit)
        scene.unlink()
        self.timed("shade", "ptcshade", lit, *self.shade, "-o", self.here / "one.ply")
        return lit

    def digest(self, scene):
        facts = json.loads(self.call("ptcverify", scene, "--level", "4", "--json"))
        return facts["tree_digest"], facts["points"]

    def run(self):
        with tempfile.TemporaryDirectory(prefix="ptc-slurm-", dir="/tmp") as home:
            self.environment = dict(os.environ, PATH=f"{self.bin}:{os.environ['PATH']}")
            os.environ["PATH"] = self.environment["PATH"]
            self.cluster = slurm_cluster.Cluster(home, NODES)
            self.environment = self.cluster.environment
            try:
                self.farm()
            finally:
                self.cluster.stop()
        lit = self.alone()
        farm, one = self.digest(self.here / "farm.ptcx"), self.digest(lit)
        same = farm == one and filecmp.cmp(self.here / "farm.ply", self.here / "one.ply", shallow=False)
        self.notes.append(f"Points: {one[1]:,}. Digest of the tree: {one[0]} on one machine, {farm[0]} by the cluster; the files of shaded points "
                          f"are {'equal, byte for byte' if same else 'DIFFERENT'}.")
        settings = " ".join(f"--{name.replace('_', '-')} {getattr(self.arguments, name)}" for name in ("points", "count", "bounces", "task_memory", "error") if getattr(self.arguments, name))
        text = ["# A city by a cluster of Slurm", "",
                f"Written by `python3 tests/farm/slurm_run.py build/release/bin FOLDER {settings} --output ...`, one run. A real slurmctld and four slurmd on "
                f"one machine of {os.cpu_count()} cores, so that nodes share its cores and its disk: the times say what tasks cost, not what four machines gain.", "",
                "| step | by | tasks | wall s | CPU s |", "|---|---|---|---|---|"]
        text += ["| " + " | ".join(map(str, row)) + " |" for row in self.rows]
        text += ["", *(f"- {note}" for note in self.notes), ""]
        self.arguments.output.write_text("\n".join(text))
        print("\n".join(text))
        return 0 if same else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bin", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--points", default="200M")
    parser.add_argument("--count", default="16k")
    parser.add_argument("--bounces", default="1", help="2 or more: each further bounce is a wave of tasks that lights every point before --count points are shaded")
    parser.add_argument("--task-memory", default="1G", help="the cap of each task: smaller ones make more parts")
    parser.add_argument("--error")
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    if reason := slurm_cluster.missing():
        sys.exit(reason)
    if shutil.disk_usage(arguments.folder.parent).free < 130 * amount(arguments.points):
        sys.exit(f"{arguments.folder}: there is less room than 130 bytes for each point")
    sys.exit(Run(arguments).run())
