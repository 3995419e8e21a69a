"""The tasks of a farm under faults: a task that fails or is killed says so, leaves no half file under a final name, and the
plan still comes to the bytes that it comes to without faults.

    route.0 -> part.0, part.1 -> join -> light.0, light.1 -> join_light -> bounce_1.0, bounce_1.1 -> join_bounce_1
            -> shade.0 -> collect -> frame.0, frame.1                    a fault in one of them, then `ptcfarm run`
"""

import json
import random
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from pathlib import Path

from harness import BIN, HARMLESS, SECONDS, TEMPORARY, Run, environment, text_of

# The marks of tasks of a plan that lights, where they have other names
MARKS = {"part.0": "unlit.0", "join": "unlit", "light.0": "part.0", "join_light": "join"}
COARSE = ["--solid-angle", "0.3", "--resolution", "16", "--parallax", "0.4", "--bounces", "2"]
HOWS = {"eio": "Input/output error", "enospc": "No space left on device", "kill": "", "stale": ""}


class Farm:
    """A plan in a folder, and the state of the folder before each of its tasks."""

    def __init__(self, home):
        self.home = Path(home) / "farm"
        self.states = Path(home) / "states"
        self.report = Path(home) / "report"
        self.home.mkdir()
        self.states.mkdir()
        self.plan, self.marks = self.home / "city.json", "city.parts"
        pictures = ["-o", str(self.home / "turn.#.exr"), "--turntable", "2", "--size", "16x12", "--samples", "1", *COARSE]
        planned = self.call("plan", "--city", "3k", "--parts", "2", "--sun", "200,35", "--shade", self.home / "lit.ply", *COARSE,
                            "--render", " ".join(pictures), "--task-memory", "256M", "--page-size", "4K", "-o", self.plan)
        assert planned.code == 0, planned.errors
        self.tasks = json.loads(self.plan.read_text())["tasks"]
        self.after = {}  # by task: the files when it has ended, and their bytes
        for task in self.tasks:
            shutil.copytree(self.home, self.states / task["name"])
            done = self.run(task)
            assert done.code == 0, (task["name"], done.errors)
            self.after[task["name"]] = self.files()
        self.end = self.files()

    def call(self, *words, **fault):
        command = [str(BIN / "ptcfarm"), *map(str, words)]
        self.report.unlink(missing_ok=True)
        ended = subprocess.run(command, capture_output=True, text=True, cwd=self.home, timeout=SECONDS,
                               env=environment(self.home, self.report, **fault))
        return Run(ended.returncode, ended.stderr, text_of(self.report))

    def run(self, task, **fault):
        return self.call(*task["command"][1:], **fault)

    def restore(self, task):
        shutil.rmtree(self.home)
        shutil.copytree(self.states / task["name"], self.home)

    def files(self):
        """Returns all files but logs, by their place, with their bytes."""
        return {str(path.relative_to(self.home)): path.read_bytes() for path in sorted(self.home.rglob("*"))
                if path.is_file() and path.parent.name != "log"}

    def complaints(self, task, run, how, on):
        """Returns what is wrong after a task under a fault, and after the plan has gone on."""
        wrong = []
        name, after = task["name"], self.after[task["name"]]
        killed = how == "kill" and run.code == -9
        if run.code < 0 and not killed:
            wrong.append(f"signal {-run.code}")
        if run.code > 0 and not re.search("^ptcfarm: ", run.errors, re.M):
            wrong.append("no message")
        if run.code == 3 and (HOWS[how] not in run.errors or str(self.home) not in run.errors):
            wrong.append("the message lacks the error or the file")
        # What comes of a look at a file is seen in the outputs
        if run.code == 0 and run.call and run.call not in HARMLESS | {"stat"} and how != "stale":
            wrong.append("the error is swallowed")
        now = self.files()
        before = {str(path.relative_to(self.states / name)) for path in (self.states / name).rglob("*") if path.is_file()}
        may_stay = killed or run.call == "unlink" or on
        for place, content in now.items():
            temporary = TEMPORARY.fullmatch(Path(place).name)
            if temporary and not may_stay:
                wrong.append(f"left behind: {place}")
            if not temporary and place not in before and "/failed/" not in place and content != after.get(place):
                wrong.append(f"a half file: {place}")
        # A task may fail once its outputs are there and it is marked as done: then nothing is lost
        outputs = [str(Path(path).relative_to(self.home)) for path in task["outputs"]]
        if f"{self.marks}/done/{MARKS.get(name, name)}" in now:
            if any(place not in now for place in outputs):
                wrong.append("it is marked as done without its outputs")
        elif run.code == 0:
            wrong.append("it ended well and is not marked as done")
        elif "not seen from this machine" in run.errors:
            pass
        elif not killed and not on and run.path != str(self.plan) and f"{self.marks}/failed/{name}" not in now:
            wrong.append("it failed and is not marked so")
        again = self.call("run", self.plan)
        if again.code != 0:
            wrong.append(f"going on: exit {again.code}: {again.errors.strip()[:300]}")
        end = self.files()
        wrong += [f"going on: {place} stays" for place in end
                  if "/failed/" in place and place.replace("/failed/", "/done/") not in end]
        for place, content in self.end.items():
            if not re.search(r"/(done|log)/", place) and end.get(place) != content:
                wrong.append(f"going on: {place} has other bytes")
        return wrong


def fail_tasks(arguments, tally):
    """Lets calls on files fail, or kills before them, in each kind of task of a farm; then the plan goes on."""
    with tempfile.TemporaryDirectory(prefix="ptc-faults-") as home:
        farm = Farm(home)
        for task in farm.tasks:
            kind = task["kind"]
            if task["number"] == 1 and kind != "frame":  # the last picture removes the bounces
                continue
            codes, runs = Counter(), 0
            for how in HOWS:
                farm.restore(task)
                count = farm.run(task, how=how).calls
                assert count > 0, f"{task['name']}: no call can be hit"
                whole = arguments.all or (how, task["name"]) == ("stale", "join")  # where a part was lost once
                few = kind in ("light", "join_light", "bounce", "join_bounce", "frame")  # much is as in other kinds
                chosen = arguments.steps(count, 10 ** 9 if whole else 1 if few else 4)
                for at in chosen:
                    # Every second one goes on failing, as a full disk does
                    on = how not in ("kill", "stale") and random.Random(f"{task['name']} {how} {at}").random() < 0.5
                    farm.restore(task)
                    run = farm.run(task, how=how, at=at, on=on)
                    codes[run.code] += 1
                    runs += 1
                    for wrong in farm.complaints(task, run, how, on):
                        tally.fail(f"{task['name']}: {how} at {at} of {count}{' and on' if on else ''}"
                                   f" ({run.call} {run.path}): {wrong}; exit {run.code}: {run.errors.strip()[:300]}")
            print(f"  {task['name']}: {runs} runs; exit codes {dict(codes)}", flush=True)
