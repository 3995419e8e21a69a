"""Shared by the fault tests: programs on tiny inputs, runs with a fault, and what must hold after each.

PTC_BIN is the directory of the programs, PTC_CALLS the library to preload (calls.cpp), empty when
the programs run under a sanitizer, which has an allocator and calls of its own.
"""

import math
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

BIN = Path(os.environ["PTC_BIN"])
CALLS = os.environ.get("PTC_CALLS", "")
OLD = b"what was there before\n" * 1000
SECONDS = 120  # a run that takes longer hangs
# Failures of these calls do not affect the result
HARMLESS = {"close", "unlink", "fallocate"}
TEMPORARY = re.compile(r"\..+\.tmp-[\w.]+-\d+-[0-9a-f]{8}-\d+(\.ptcx)?")


def ball(count):
    """Writes points, normals, radii and colours of lit surfels spread over a ball."""
    draw = random.Random(1)
    points = []
    for i in range(count):
        z, turn = 1 - (2 * i + 1) / count, 2.399963229728653 * i
        ring = math.sqrt(1 - z * z)
        normal = (ring * math.cos(turn), ring * math.sin(turn), z)
        points.append((*normal, *normal, math.sqrt(2 * math.pi / count), *(draw.random() for _ in range(6))))
    return points


def write_ply(path, points):
    names = "x y z nx ny nz radius radiance_r radiance_g radiance_b red green blue".split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}",
              *(f"property float {name}" for name in names), "end_header", ""]
    record = struct.Struct("<13f")
    path.write_bytes("\n".join(header).encode() + b"".join(record.pack(*point) for point in points))


class Scenario:
    """One command. `{in}` in an argument is the directory of inputs, `{out}` that of the target. A command that `keeps`
    leaves files from which the same command continues."""

    def __init__(self, name, command, target="", slow=False, keeps=False):
        self.name, self.command, self.target, self.slow, self.keeps = name, command.split(), target, slow, keeps

    def __str__(self):
        return self.name


SCENARIOS = [
    Scenario("build cloud", "ptcbuild {in}/ball.ply -o {out}/o.ptcx --threads 1 --page-size 4K", "o.ptcx"),
    Scenario("build packed", "ptcbuild {in}/ball.ply.gz -o {out}/o.ptcx --threads 1", "o.ptcx"),
    Scenario("build mesh", "ptcbuild {in}/box.obj -o {out}/o.ptcx --points 500 --threads 2", "o.ptcx"),
    Scenario("build spilling", "ptcbuild --city 700K --memory 106M --threads 2 --page-size 1M --profile raw"
             " --temp {in}/temp -o {out}/o.ptcx", "o.ptcx", slow=True),
    Scenario("build spread", "ptcbuild --city 700K --memory 106M --threads 2 --page-size 1M --profile raw"
             " --temp {in}/temp --temp {in}/more -o {out}/o.ptcx", "o.ptcx", slow=True),
    Scenario("build resumed", "ptcbuild --city 150K --memory 190M --threads 2 --resume --checkpoint 50K"
             " --temp {in}/temp --temp {in}/more -o {out}/o.ptcx", "o.ptcx", slow=True, keeps=True),
    Scenario("append", "ptcbuild {in}/ball.ply --append {in}/ball.ptcx -o {out}/o.ptcx --threads 1", "o.ptcx"),
    Scenario("shade to container", "ptcshade {in}/ball.ptcx -o {out}/o.ptcx --threads 1", "o.ptcx"),
    Scenario("shade to cloud", "ptcshade {in}/ball.ptcx -o {out}/o.ply --threads 2", "o.ply"),
    Scenario("shade mapped", "ptcshade {in}/ball.ptcx -o {out}/o.ply --threads 1 --io mmap", "o.ply"),
    Scenario("shade bounces", "ptcshade {in}/ball.ptcx -o {out}/o.ptcx --threads 2 --bounces 2 --temp {in}/temp",
             "o.ptcx"),
    Scenario("light", "ptclight {in}/ball.ptcx --sun 30,60 --sky 0.5 -o {out}/o.ptcx --threads 1", "o.ptcx"),
    Scenario("render", "ptcrender {in}/ball.ptcx -o {out}/o.exr --size 24x16 --samples 1 --threads 1"
             " --camera 0,0,3,0,0,0", "o.exr"),
    Scenario("convert to cloud", "ptcconvert {in}/ball.ptcx {out}/o.ply --threads 1", "o.ply"),
    Scenario("convert to text", "ptcconvert {in}/ball.ptcx {out}/o.xyz --threads 1", "o.xyz"),
    Scenario("convert to profile", "ptcconvert {in}/ball.ptcx {out}/o.ptcx --profile fast --threads 1", "o.ptcx"),
    Scenario("convert from text", "ptcconvert {in}/ball.xyz {out}/o.ptcx --threads 1", "o.ptcx"),
    Scenario("verify", "ptcverify {in}/ball.ptcx --threads 1"),
    Scenario("info", "ptcinfo {in}/ball.ptcx"),
]


class Run:
    """A finished run: exit code (None: it hung), stderr, the call and the path that the fault hit, the number of calls
    that it could hit and, when it hit none, their names."""

    def __init__(self, code, errors, report):
        self.code, self.errors = code, errors
        hit = re.search(r"^hit (\S+) ?(.*)$", report, re.M)
        self.call, self.path = hit.groups() if hit else ("", "")
        of = re.search(r"^of (\d+)$", report, re.M)
        self.calls = int(of[1]) if of else 0
        self.names = re.findall(r"^call (\S+)$", report, re.M)


def environment(home, report, how="", at=0, on=False, trace=None):
    """Returns the environment of a run with a fault at its calls on files below `home`; `report` tells what it hit."""
    asked = {"LD_PRELOAD": CALLS, "PTC_FAULTS_DIR": str(home), "PTC_FAULTS_HOW": how, "PTC_FAULTS_AT": str(at),
             "PTC_FAULTS_REPORT": str(report)}
    if on:
        asked["PTC_FAULTS_ON"] = "1"
    if trace:
        asked["PTC_FAULTS_TRACE"] = str(trace)
    return {**os.environ, **asked} if CALLS else dict(os.environ)


def text_of(report):
    return report.read_text(errors="replace") if report.exists() else ""


class Place:
    """The directories for the runs of one scenario, one run at a time."""

    def __init__(self, scenario, home):
        self.scenario = scenario
        self.home = Path(home)
        self.out = self.home / "out"
        self.out.mkdir(parents=True)
        self.temps = [self.home / "temp", self.home / "more"]
        for temp in self.temps:
            temp.mkdir()
        make_inputs(self.home)
        self.target = self.out / scenario.target if scenario.target else None
        self.report = Path(f"{home}.report")
        self.old, self.new = OLD, b""  # content of the target before and after
        clean = self.run()
        assert clean.code == 0, (scenario.name, clean.errors)
        if self.target:
            self.new = self.target.read_bytes()

    def command(self):
        words = [w.replace("{in}", str(self.home)).replace("{out}", str(self.out)) for w in self.scenario.command]
        return [str(BIN / words[0]), *words[1:]]

    def reset(self, old=OLD):
        self.old = old
        for path in self.files():
            path.unlink()
        if self.target and old:
            self.target.write_bytes(old)
        self.report.unlink(missing_ok=True)

    def files(self):
        return [path for folder in (self.out, *self.temps) for path in folder.iterdir()]

    @property
    def preloaded(self):
        return bool(CALLS)

    def most(self, arguments, quick, slow):
        """Returns the number of runs of a kind; a slow scenario is never run for all of its calls."""
        if arguments.all:
            return 100 if self.scenario.slow else 10 ** 9
        return slow if self.scenario.slow else quick

    def start(self, reset=True, old=OLD, **fault):
        if reset:
            self.reset(old)
        return subprocess.Popen(self.command(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                errors="replace", cwd=self.home, env=environment(self.home, self.report, **fault))

    def run(self, **fault):
        return self.end(self.start(**fault))

    def end(self, process):
        try:
            errors = process.communicate(timeout=SECONDS)[1]
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Run(None, "", "")
        return Run(process.returncode, errors, text_of(self.report))

    def leftovers(self):
        return sorted(path.name for path in self.files() if path != self.target)

    def complaints(self, run, may_leave=False):
        """Returns what is wrong after a fault: a hang, a signal, a half file, a temporary file. A run that keeps files is
        continued."""
        wrong = self.complaints_alone(run, may_leave)
        if self.scenario.keeps and run.code is not None:
            again = self.run(reset=False)
            wrong += [f"going on: {text}" for text in self.complaints_alone(again, may_leave)]
            wrong += [f"going on: exit {again.code}: {again.errors.strip()[:300]}"] * (again.code != 0)
        return wrong

    def complaints_alone(self, run, may_leave=False):
        if run.code is None:
            return ["it hangs"]
        wrong = []
        if run.code < 0:
            wrong.append(f"signal {-run.code}")
        if self.target:
            have = self.target.read_bytes() if self.target.exists() else None
            if have not in (self.old, self.new):
                wrong.append("the target is neither the old file nor the new one")
            elif run.code == 0 and have != self.new:
                wrong.append("exit 0 without the new file")
        if run.code > 0 and not re.search(f"^{self.scenario.command[0]}: ", run.errors, re.M):
            wrong.append("no message")
        keeps = self.scenario.keeps and (run.code != 0 or (may_leave and run.call))
        kept = r"o\.ptcx\.resume(-.+)?" if keeps else "$^"
        left = [name for name in self.leftovers()
                if not (may_leave and TEMPORARY.fullmatch(name)) and not re.fullmatch(kept, name)]
        if left:
            wrong.append(f"left behind: {' '.join(left)}")
        return wrong


INPUTS = {}


def make_inputs(home):
    """Makes the inputs, once, and copies them."""
    if not INPUTS:
        with tempfile.TemporaryDirectory(prefix="ptc-faults-") as scratch:
            here = Path(scratch)
            points = ball(600)
            write_ply(here / "ball.ply", points)
            lines = [" ".join(f"{value:.6g}" for value in point[:6]) for point in points]
            (here / "ball.xyz").write_text("\n".join(lines) + "\n")
            subprocess.run(["gzip", "-k", here / "ball.ply"], check=True)
            (here / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\n"
                                          "f 4 3 2 1\nf 1 2 6 5\n")
            subprocess.run([BIN / "ptcbuild", here / "ball.ply", "-o", here / "ball.ptcx", "--quiet",
                            "--page-size", "4K"], check=True)
            INPUTS.update({path.name: path.read_bytes() for path in here.iterdir()})
    for name, data in INPUTS.items():
        (home / name).write_bytes(data)


class Tally:
    """Counts runs and collects complaints."""

    def __init__(self):
        self.failures = 0

    def fail(self, text):
        self.failures += 1
        if self.failures <= 40:
            print(f"  FAILED {text}", flush=True)

    def end(self):
        if self.failures:
            sys.exit(f"{self.failures} failures")


def each_scenario(names, work, workers=2):
    """Calls work(place) for the scenarios, a few at a time, each in its own directories."""
    home = Path(tempfile.mkdtemp(prefix="ptc-faults-"))

    def one(index_and_scenario):
        index, scenario = index_and_scenario
        return work(Place(scenario, home / str(index)))

    try:
        with ThreadPoolExecutor(workers) as pool:
            chosen = [s for s in SCENARIOS if not names or s.name in names]
            list(pool.map(one, enumerate(chosen)))
    finally:
        shutil.rmtree(home)
