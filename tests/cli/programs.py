"""Shared by the tests of the programs: small inputs, running a program, and what must hold afterwards.

Tests run with PTC_BIN, the directory of the programs, and PTC_PROGRAMS, their names with blanks
between them; they need the standard library only.
"""

import math
import os
import pty
import random
import struct
import subprocess
import tempfile
import unittest
from pathlib import Path

BIN = Path(os.environ["PTC_BIN"])
PROGRAMS = os.environ["PTC_PROGRAMS"].split()
CORE = ["x", "y", "z", "nx", "ny", "nz", "radius", "radiance_r", "radiance_g", "radiance_b",
        "red", "green", "blue"]
WRITTEN = CORE[:10] + ["albedo_r", "albedo_g", "albedo_b"] + CORE[10:]
SMALL_PICTURE = ["--camera", "0.5,0.5,3,0.5,0.5,0.5", "--size", "24x16", "--samples", "1"]


def run(program, *arguments, **options):
    """Runs a program to its end. Returns its exit code, standard output and standard error."""
    command = [str(BIN / program), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=250, **options)


def run_on_terminal(program, *arguments):
    """Runs a program whose standard error is a terminal. Returns its exit code and what it wrote there."""
    ours, theirs = pty.openpty()
    command = [str(BIN / program), *map(str, arguments)]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    written = b""
    try:
        while block := os.read(ours, 65536):
            written += block
    except OSError:  # the program has closed the terminal
        pass
    os.close(ours)
    return child.wait(timeout=250), written.decode()


def write_ply(path, points, names=CORE):
    """Writes a binary PLY of floats, with positions in double."""
    kinds = ["double" if name in "xyz" else "float" for name in names]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {kind} {name}" for kind, name in zip(kinds, names)] + ["end_header", ""]
    record = struct.Struct("<" + "".join("d" if kind == "double" else "f" for kind in kinds))
    path.write_bytes("\n".join(header).encode() + b"".join(record.pack(*p) for p in points))


def read_ply(path):
    """Reads a PLY that a program wrote. Returns the property names and a list of tuples."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names, code = [], "<"
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "property":
            code += {"double": "d", "float": "f", "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i",
                     "uint": "I"}[words[1]]
            names.append(words[2])
        elif words[0] == "element":
            count = int(words[2])
    points = list(struct.iter_unpack(code, data[end:]))
    assert len(points) == count
    return names, points


def ball(count, seed=1):
    """Returns lit surfels spread over a ball."""
    draw = random.Random(seed)
    points = []
    for i in range(count):
        z, turn = 1 - (2 * i + 1) / count, 2.399963229728653 * i
        ring = math.sqrt(1 - z * z)
        normal = (ring * math.cos(turn), ring * math.sin(turn), z)
        colour = [draw.random() for _ in range(6)]
        points.append((*normal, *normal, math.sqrt(2 * math.pi / count), *colour))
    return points


BOX = """v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
v 0 1 0
v 1 1 0
f 4 3 2 1
f 1 2 6 5
"""


class ProgramTest(unittest.TestCase):
    """Gives every test its own directory with a small mesh, cloud and container."""

    @classmethod
    def setUpClass(cls):
        cls.fixture = tempfile.TemporaryDirectory(prefix="ptc-cli-")
        home = Path(cls.fixture.name)
        (home / "box.obj").write_text(BOX)
        write_ply(home / "ball.ply", ball(600))
        for source, target in (("ball.ply", "ball.ptcx"), ("box.obj", "box.ptcx")):
            made = run("ptcbuild", home / source, "-o", home / target, "--points", "3k")
            assert made.returncode == 0, made.stderr

    @classmethod
    def tearDownClass(cls):
        cls.fixture.cleanup()

    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory(prefix="ptc-cli-")
        self.addCleanup(self.scratch.cleanup)
        self.here = Path(self.scratch.name)
        home = Path(self.fixture.name)
        self.mesh, self.cloud = home / "box.obj", home / "ball.ply"
        self.scene, self.box = home / "ball.ptcx", home / "box.ptcx"

    def succeed(self, program, *arguments, **options):
        result = run(program, *arguments, **options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def fail_with(self, code, program, *arguments, **options):
        """Expects an exit code, one message and nothing new in this directory."""
        before = sorted(os.listdir(self.here))
        result = run(program, *arguments, **options)
        self.assertEqual(result.returncode, code, (program, arguments, result.stdout, result.stderr))
        self.assertTrue(result.stderr.startswith(program + ": "), result.stderr)
        self.assertEqual(sorted(os.listdir(self.here)), before)
        return result.stderr
