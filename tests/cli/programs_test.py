"""The programs as a user meets them: exit codes, messages, what they leave behind, round trips.

Run by ctest with PTC_BIN, the directory of the programs; needs the standard library only.
"""

import json
import math
import os
import random
import resource
import signal
import struct
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

BIN = Path(os.environ["PTC_BIN"])
PROGRAMS = ["ptcbuild", "ptcshade", "ptcrender", "ptcconvert", "ptcinfo", "ptcverify"]
CORE = ["x", "y", "z", "nx", "ny", "nz", "radius", "radiance_r", "radiance_g", "radiance_b",
        "red", "green", "blue"]
SMALL_PICTURE = ["--camera", "0.5,0.5,3,0.5,0.5,0.5", "--size", "24x16", "--samples", "1"]


def run(program, *arguments, **options):
    """Runs a program to its end; its exit code, standard output and standard error."""
    command = [str(BIN / program), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=250, **options)


def write_ply(path, points, names=CORE):
    """Binary PLY of floats, positions in double."""
    kinds = ["double" if name in "xyz" else "float" for name in names]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {kind} {name}" for kind, name in zip(kinds, names)] + ["end_header", ""]
    record = struct.Struct("<" + "".join("d" if kind == "double" else "f" for kind in kinds))
    path.write_bytes("\n".join(header).encode() + b"".join(record.pack(*p) for p in points))


def read_ply(path):
    """The points of a PLY written by the programs: property names, list of tuples."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    names, code = [], "<"
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "property":
            code += {"double": "d", "float": "f"}[words[1]]
            names.append(words[2])
        elif words[0] == "element":
            count = int(words[2])
    points = list(struct.iter_unpack(code, data[end:]))
    assert len(points) == count
    return names, points


def ball(count, seed=1):
    """Lit surfels spread over a ball."""
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
    """A directory of its own for every test, with a small mesh, cloud and container."""

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


class Usage(ProgramTest):
    def test_help_shows_examples_and_every_common_option(self):
        for program in PROGRAMS:
            text = self.succeed(program, "--help").stdout
            self.assertIn("Examples:\n  " + program, text)
            for option in ("--memory", "--threads", "--temp", "--progress", "--quiet", "--json",
                           "--version", "--help", "Exit codes"):
                self.assertIn(option, text, program)

    def test_examples_in_the_help_parse(self):
        # Their files are not there: they must fail for that and for nothing else.
        for program in PROGRAMS:
            for line in self.succeed(program, "--help").stdout.split("Examples:\n")[1].splitlines():
                if not line.startswith("  " + program) or "--city" in line:
                    continue
                words = line.split("|")[0].replace("/scratch", str(self.here)).split()
                message = self.fail_with(1, program, *words[1:], cwd=self.here)
                self.assertIn("No such file or directory", message, line)

    def test_version_names_program_and_format(self):
        for program in PROGRAMS:
            self.assertRegex(self.succeed(program, "--version").stdout,
                             rf"^{program} \d+\.\d+\.\d+ \(PTCX format \d+\.\d+\)\n$")

    def test_unknown_options_and_missing_arguments_are_usage_errors(self):
        for program in PROGRAMS:
            self.assertIn("--help", self.fail_with(2, program))
            self.assertIn("--help", self.fail_with(2, program, "--no-such-option", "file"))

    def test_wrong_values_of_common_options_are_usage_errors(self):
        for program in PROGRAMS:
            operands = {"ptcinfo": [self.scene], "ptcverify": [self.scene],
                        "ptcconvert": [self.scene, self.here / "o.ply"],
                        "ptcrender": [self.scene, "-o", self.here / "o.png"],
                        "ptcshade": [self.scene, "-o", self.here / "o.ply"],
                        "ptcbuild": [self.cloud, "-o", self.here / "o.ptcx"]}[program]
            for option, value in (("--memory", "much"), ("--memory", "0"), ("--memory", "-1"),
                                  ("--memory", "9999999T"), ("--memory", "nan"), ("--memory", ""),
                                  ("--threads", "-1"), ("--threads", "1.5"), ("--threads", "99999"),
                                  ("--temp", self.here / "none"), ("--temp", self.mesh)):
                self.assertIn(option, self.fail_with(2, program, *operands, f"{option}={value}"))

    def test_wrong_values_of_other_options_are_usage_errors(self):
        cases = {
            "ptcbuild": ["--points=0", "--points=-5", "--points=1.5", "--points=1e99", "--points=x",
                         "--spacing=0", "--spacing=nan", "--spacing=inf", "--sun=1", "--sun=1,91",
                         "--sun=1,2,-3", "--sun=a,b", "--sun-size=-1", "--sun-colour=1,2",
                         "--point=1,2,3", "--point=0,0,0,1,1,-1", "--sky=1,2", "--sky=-1",
                         "--sky-scale=-1", "--camera=1,2,3", "--camera=1,2,3,1,2,3", "--fov=40",
                         "--leaf=0", "--leaf=65536", "--levels-per-stream=0", "--codec=lzma",
                         "--page-size=3K", "--page-size=2M", "--sun-rays=0", "--finest=0",
                         "--city=5", "--output="],
            "ptcshade": ["--solid-angle=0", "--parallax=-1", "--inflation=nan",
                         "--inflation=0", "--resolution=7", "--resolution=65", "--sides=back",
                         "--lift=-1", "--io=mail", "--check=-1", "--check-rays=0"],
            "ptcrender": ["--size=10", "--size=0x10", "--size=10x", "--size=-1x5", "--size=10x70000",
                          "--samples=0", "--samples=3", "--exposure=inf", "--layer=depth=a.png",
                          "--layer=direct=a.exr", "--layer=direct", "--camera=0,0,0,0,0,0"],
            "ptcconvert": ["--codec=", "--page-size=64"],
        }
        operands = {"ptcbuild": [self.mesh, "-o", self.here / "o.ptcx"],
                    "ptcshade": [self.scene, "-o", self.here / "o.ply"],
                    "ptcrender": [self.scene, "-o", self.here / "o.png"],
                    "ptcconvert": [self.scene, self.here / "o.ptcx"]}
        for program, options in cases.items():
            for option in options:
                self.fail_with(2, program, *operands[program], option)

    def test_names_of_outputs_must_tell_their_kind(self):
        for program, operands in (("ptcbuild", [self.mesh, "-o"]), ("ptcshade", [self.scene, "-o"]),
                                  ("ptcrender", [self.scene, "-o"]), ("ptcconvert", [self.scene])):
            for name in ("out", "out.txt", ".png", "out.ptcx.bak"):
                self.assertIn("must end in", self.fail_with(2, program, *operands, self.here / name))

    def test_inputs_and_city_exclude_each_other_and_one_is_needed(self):
        self.fail_with(2, "ptcbuild", self.mesh, "--city", "1k", "-o", self.here / "o.ptcx")
        self.fail_with(2, "ptcbuild", "-o", self.here / "o.ptcx")

    def test_a_cap_that_is_too_small_names_the_least_that_works(self):
        for program, operands in (("ptcbuild", [self.mesh, "--points", "1k", "-o", self.here / "o.ptcx"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ply"]),
                                  ("ptcrender", [self.scene, "-o", self.here / "o.png"]),
                                  ("ptcverify", [self.scene])):
            message = self.fail_with(2, program, *operands, "--memory", "1M")
            least = message.split("the least that works is ")[1].split()[0]
            self.succeed(program, *operands, "--memory", least,
                         *(SMALL_PICTURE if program == "ptcrender" else []))


class BadInput(ProgramTest):
    """Every kind of bad file, everywhere a program reads one: exit 1, the path, nothing left."""

    def consumers(self, kind):
        """Commands that read a file of a kind, with a place for its name."""
        out = {"ptcx": self.here / "out.ptcx", "ply": self.here / "out.ply",
               "png": self.here / "out.png", "exr": self.here / "out.exr"}
        commands = {
            "cloud": [["ptcbuild", "{}", "-o", out["ptcx"]],
                      ["ptcbuild", self.mesh, "{}", "-o", out["ptcx"]],
                      ["ptcconvert", "{}", out["ptcx"]],
                      ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ply"]],
                      ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ptcx"]]],
            "mesh": [["ptcbuild", "{}", "-o", out["ptcx"]],
                     ["ptcconvert", "{}", out["ptcx"]],
                     ["ptcrender", self.box, "--mesh", "{}", "-o", out["png"]]],
            "container": [["ptcinfo", "{}"], ["ptcverify", "{}"],
                          ["ptcshade", "{}", "-o", out["ptcx"]],
                          ["ptcshade", "{}", "-o", out["ply"]],
                          ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ply"]],
                          ["ptcrender", "{}", "-o", out["png"]],
                          ["ptcrender", "{}", "-o", out["exr"]],
                          ["ptcconvert", "{}", out["ply"]],
                          ["ptcconvert", "{}", self.here / "out.xyz"],
                          ["ptcconvert", "{}", out["ptcx"]]],
            "sky": [["ptcbuild", self.mesh, "-o", out["ptcx"], "--sky", "{}"],
                    ["ptcshade", self.scene, "-o", out["ply"], "--sky", "{}"],
                    ["ptcrender", self.scene, "-o", out["png"], "--sky", "{}"]],
        }
        return commands[kind]

    def refuse(self, kind, path, *places):
        """Expects every consumer of a kind to refuse a file, naming it and one of `places`."""
        for command in self.consumers(kind):
            arguments = [path if word == "{}" else word for word in command]
            message = self.fail_with(1, *arguments)
            self.assertIn(str(path), message)
            if places:
                self.assertTrue(any(place in message for place in places), message)

    def test_missing_files_and_directories(self):
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"),
                             ("container", ".ptcx"), ("sky", ".exr")):
            self.refuse(kind, self.here / ("none" + ending), "No such file or directory")
            self.refuse(kind, self.here / "none" / ("none" + ending))
            directory = self.here / ("directory" + ending)
            directory.mkdir()
            self.refuse(kind, directory, "Is a directory")
            os.mkfifo(self.here / ("pipe" + ending))
            self.refuse(kind, self.here / ("pipe" + ending), "Is not a regular file")
            os.remove(self.here / ("pipe" + ending))
            directory.rmdir()

    def test_empty_files(self):
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"),
                             ("mesh", ".gltf"), ("container", ".ptcx"), ("sky", ".exr"),
                             ("sky", ".png")):
            path = self.here / ("empty" + ending)
            path.touch()
            self.refuse(kind, path, "offset 0")

    def test_files_with_a_wrong_magic(self):
        noise = random.Random(7).randbytes(20000)
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"), ("mesh", ".glb"),
                             ("mesh", ".off"), ("container", ".ptcx"), ("sky", ".exr"),
                             ("sky", ".png")):
            path = self.here / ("noise" + ending)
            path.write_bytes(noise)
            self.refuse(kind, path)
        text = bytearray(self.scene.read_bytes())
        text[4] = 10  # a text-mode copy
        path = self.here / "text.ptcx"
        path.write_bytes(text)
        self.refuse("container", path, "offset 0")

    def test_truncated_clouds_and_meshes(self):
        for source, kind in ((self.cloud, "cloud"), (self.mesh, "mesh")):
            whole = source.read_bytes()
            path = self.here / ("short" + source.suffix)
            for share in (0.02, 0.2, 0.5):
                path.write_bytes(whole[:int(len(whole) * share)])
                self.refuse(kind, path)
        path = self.here / "short.ply"
        path.write_bytes(self.cloud.read_bytes()[:-1])
        self.refuse("cloud", path, "offset ")

    def test_truncated_containers(self):
        whole = self.scene.read_bytes()
        path = self.here / "short.ptcx"
        for size in (1, 7, 8, 100, 4095, 4096, 5000, len(whole) // 2, len(whole) - 8192,
                     len(whole) - 4096, len(whole) - 1):
            path.write_bytes(whole[:size])
            self.refuse("container", path, "offset ")

    def test_containers_that_grew(self):
        path = self.here / "long.ptcx"
        for tail in (b"\0", b"\0" * 4096, b"x" * 9000):
            path.write_bytes(self.scene.read_bytes() + tail)
            self.refuse("container", path, "offset ")

    def test_containers_with_a_damaged_page(self):
        whole = self.scene.read_bytes()
        path = self.here / "damaged.ptcx"
        damaged = bytearray(whole)
        damaged[4096 + 200] ^= 1  # the payload of the first page, points
        path.write_bytes(damaged)
        for command in self.consumers("container"):
            if command[0] == "ptcinfo":
                continue  # reads no points
            arguments = [path if word == "{}" else word for word in command]
            message = self.fail_with(1, *arguments, *(SMALL_PICTURE if command[0] == "ptcrender" else []))
            self.assertIn(f"{path}: offset 4", message)
            self.assertIn("checksum", message)

    def test_points_with_impossible_numbers(self):
        good = ball(50)
        for name, value in (("x", math.nan), ("z", math.inf), ("nx", math.nan), ("radius", -1.0),
                            ("radius", math.nan), ("radius", math.inf), ("radiance_g", -0.5),
                            ("radiance_b", math.nan)):
            for place in (0, 49):
                points = [list(p) for p in good]
                points[place][CORE.index(name)] = value
                path = self.here / "bad.ply"
                write_ply(path, points)
                self.refuse("cloud", path, f"point {place}")
        points = [list(p) for p in good]
        points[20][3:6] = [0, 0, 0]
        write_ply(path, points)
        self.refuse("cloud", path, "normal")

    def test_lines_with_impossible_numbers(self):
        path = self.here / "bad.xyz"
        good = "0 0 0 0 1 0 0.1 1 1 1\n"
        for bad in ("nan 0 0 0 1 0 0.1 1 1 1", "0 0 0 0 0 0 0.1 1 1 1", "0 0 0 0 1 0 -0.1 1 1 1",
                    "0 0 0 0 1 0 0.1 1 -1 1", "0 0 0 0 1 0 0.1 1 1", "0 0 0 0 1 zero 0.1 1 1 1"):
            path.write_text(good * 3 + bad + "\n" + good)
            self.refuse("cloud", path, "line 4")

    def test_meshes_with_impossible_numbers(self):
        path = self.here / "bad.obj"
        for bad in (BOX.replace("v 1 0 1", "v nan 0 1"), BOX.replace("f 4 3 2 1", "f 4 3 2 99"),
                    BOX.split("f ")[0], "f 1 2 3\n"):
            path.write_text(bad)
            self.refuse("mesh", path)

    def test_a_cloud_is_no_mesh(self):
        message = self.fail_with(1, "ptcrender", self.scene, "--mesh", self.cloud, "-o", self.here / "o.png")
        self.assertIn(str(self.cloud), message)

    def test_what_stood_under_the_name_of_the_output_stays(self):
        noise = self.here / "noise.ptcx"
        noise.write_bytes(b"not a container" * 1000)
        for kind in ("cloud", "container"):
            for command in self.consumers(kind):
                outputs = [w for w in command if isinstance(w, Path) and w.name.startswith("out.")]
                for output in outputs:
                    output.write_text("precious")
                    arguments = [noise if word == "{}" else word for word in command]
                    self.fail_with(1, *arguments)
                    self.assertEqual(output.read_text(), "precious")
                    output.unlink()


class SystemFailure(ProgramTest):
    def test_outputs_that_cannot_be_opened(self):
        for program, operands, name in (("ptcbuild", [self.cloud, "-o"], "o.ptcx"),
                                        ("ptcshade", [self.scene, "-o"], "o.ply"),
                                        ("ptcrender", [self.scene, *SMALL_PICTURE, "-o"], "o.png"),
                                        ("ptcconvert", [self.scene], "o.ply")):
            path = self.here / "none" / name
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path = self.here / name
            path.mkdir()
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path.rmdir()

    def test_a_full_disk_leaves_nothing(self):
        def limit():  # what is written beyond fails with EFBIG
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

        for program, operands in (("ptcbuild", [self.cloud, "-o", self.here / "o.ptcx"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ply"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ptcx"]),
                                  ("ptcrender", [self.scene, "-o", self.here / "o.exr", "--size", "200x200",
                                                 "--camera", "0,0,3,0,0,0", "--samples", "1"]),
                                  ("ptcconvert", [self.scene, self.here / "o.ply"]),
                                  ("ptcconvert", [self.scene, self.here / "o.xyz"]),
                                  ("ptcconvert", [self.scene, self.here / "o.ptcx"])):
            self.fail_with(3, program, *operands, preexec_fn=limit)

    def test_results_that_cannot_be_printed(self):
        with open("/dev/full", "w") as full:
            for program, operands in (("ptcinfo", [self.scene]), ("ptcverify", [self.scene]),
                                      ("ptcinfo", ["--help"])):
                command = [str(BIN / program), *map(str, operands)]
                result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60)
                self.assertEqual(result.returncode, 3)

    def test_a_signal_leaves_nothing(self):
        write_ply(self.here / "large.ply", ball(60000))
        self.succeed("ptcbuild", self.here / "large.ply", "-o", self.here / "large.ptcx")
        before = sorted(os.listdir(self.here))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            command = [str(BIN / "ptcshade"), self.here / "large.ptcx", "-o", self.here / "o.ptcx"]
            process = subprocess.Popen(command, stderr=subprocess.PIPE)
            deadline = time.monotonic() + 60
            while sorted(os.listdir(self.here)) == before and time.monotonic() < deadline:
                time.sleep(0.01)
            self.assertNotEqual(sorted(os.listdir(self.here)), before)
            process.send_signal(number)
            process.communicate(timeout=60)
            self.assertEqual(process.returncode, -number)
            self.assertEqual(sorted(os.listdir(self.here)), before)


class RoundTrip(ProgramTest):
    def columns(self, path):
        names, points = read_ply(path)
        order = sorted(points)
        return {name: [p[i] for p in order] for i, name in enumerate(names)}

    def test_ply_to_container_to_ply_keeps_every_point(self):
        back = self.here / "back.ply"
        self.succeed("ptcconvert", self.scene, back)
        was, now = self.columns(self.cloud), self.columns(back)
        self.assertEqual(list(now), CORE)
        for name in CORE:
            for a, b in zip(was[name], now[name], strict=True):
                if name in ("x", "y", "z"):
                    self.assertLessEqual(abs(a - b), 2 ** -40)  # half a unit of a lattice of 4
                elif name == "radius":
                    self.assertEqual(a, b)
                elif name.startswith("n"):
                    self.assertLessEqual(abs(a - b), 1.1e-4)
                elif name.startswith("radiance"):
                    self.assertLessEqual(abs(a - b), 2 ** -11 * a)
                else:
                    self.assertLessEqual(abs(a - b), 0.5 / 255 + 1e-7)

    def test_a_second_round_changes_nothing(self):
        first, second = self.here / "1.ply", self.here / "2.ply"
        self.succeed("ptcconvert", self.scene, first)
        self.succeed("ptcconvert", first, self.here / "2.ptcx")
        self.succeed("ptcconvert", self.here / "2.ptcx", second)
        for name, values in self.columns(first).items():
            for a, b in zip(values, self.columns(second)[name], strict=True):
                self.assertLessEqual(abs(a - b), 6.2e-5 if name.startswith("n") else 0, name)

    def test_container_to_xyz_to_container(self):
        self.succeed("ptcconvert", self.scene, self.here / "a.xyz")
        self.succeed("ptcconvert", self.here / "a.xyz", self.here / "b.ptcx")
        self.succeed("ptcconvert", self.scene, self.here / "a.ply")
        self.succeed("ptcconvert", self.here / "b.ptcx", self.here / "b.ply")
        a, b = self.columns(self.here / "a.ply"), self.columns(self.here / "b.ply")
        for name in ("x", "y", "z", "radius", "radiance_r", "radiance_g", "radiance_b"):
            self.assertEqual(a[name], b[name], name)

    def test_other_codecs_and_page_sizes_hold_the_same(self):
        lit = self.here / "lit.ptcx"
        self.succeed("ptcshade", self.scene, "-o", lit)
        reference = self.here / "lit.ply"
        self.succeed("ptcconvert", lit, reference)
        names, _ = read_ply(reference)
        for name in ("occlusion", "bent_normal_x", "irradiance_r", "sky_b", "indirect_g"):
            self.assertIn(name, names)
        for page_size in ("4K", "8K", "64K", "1M"):
            for codec in ("raw", "zstd"):
                other, back = self.here / "other.ptcx", self.here / "other.ply"
                self.succeed("ptcconvert", lit, other, "--codec", codec, "--page-size", page_size)
                self.succeed("ptcverify", other)
                facts = json.loads(self.succeed("ptcinfo", other, "--json").stdout)
                self.assertEqual(facts["codec"], codec)
                self.assertEqual(facts["page_size"], int(page_size[:-1]) * (1 << (20 if "M" in page_size else 10)))
                self.succeed("ptcconvert", other, back)
                self.assertEqual(back.read_bytes(), reference.read_bytes())

    def test_recoding_twice_gives_the_same_bytes(self):
        for name in ("a.ptcx", "b.ptcx"):
            self.succeed("ptcconvert", self.scene, self.here / name, "--codec", "raw")
        self.assertEqual((self.here / "a.ptcx").read_bytes(), (self.here / "b.ptcx").read_bytes())

    def test_a_container_may_be_recoded_over_itself(self):
        copy = self.here / "copy.ptcx"
        copy.write_bytes(self.scene.read_bytes())
        self.succeed("ptcconvert", copy, copy, "--codec", "raw", "--page-size", "8K")
        self.succeed("ptcverify", copy)

    def test_a_container_under_another_name_is_still_one(self):
        path = self.here / "scene.bin"
        path.write_bytes(self.scene.read_bytes())
        self.succeed("ptcconvert", path, self.here / "a.ply")
        self.succeed("ptcverify", path)

    def test_a_mesh_becomes_a_lit_container(self):
        self.succeed("ptcconvert", self.mesh, self.here / "a.ptcx", "--points", "1k")
        facts = json.loads(self.succeed("ptcinfo", self.here / "a.ptcx", "--json").stdout)
        self.assertGreater(min(facts["flux"]), 0)

    def test_a_cloud_becomes_no_cloud(self):
        self.fail_with(2, "ptcconvert", self.cloud, self.here / "a.xyz")


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

    def test_every_program_tells_machines(self):
        picture = ["-o", self.here / "o.png", *SMALL_PICTURE]
        common = {"seconds", "peak_resident_bytes"}
        for command, keys in (
                (["ptcbuild", self.mesh, "--points", "1k", "-o", self.here / "o.ptcx"],
                 {"points", "nodes", "bytes", "pages", "sort"}),
                (["ptcshade", self.scene, "-o", self.here / "o.ply"], {"receivers", "gather", "cache"}),
                (["ptcrender", self.scene, *picture], {"receivers", "gather", "cache"}),
                (["ptcconvert", self.scene, self.here / "p.ptcx"], {"points", "nodes", "bytes", "pages"}),
                (["ptcverify", self.scene], {"points", "nodes", "bytes", "pages"})):
            facts = json.loads(self.succeed(*command, "--json").stdout)
            self.assertLessEqual(keys | common, set(facts), command[0])
            self.assertGreater(facts["peak_resident_bytes"], 1 << 20)
        shade = json.loads(self.succeed("ptcshade", self.scene, "-o", self.here / "o.ply", "--json").stdout)
        cache = shade["cache"]
        self.assertEqual(cache["lookups"], cache["local_hits"] + cache["shared_hits"] + cache["misses"])

    def test_quiet_programs_say_nothing(self):
        for command in (["ptcinfo", self.scene], ["ptcverify", self.scene],
                        ["ptcbuild", self.cloud, "-o", self.here / "o.ptcx"],
                        ["ptcconvert", self.scene, self.here / "o.ply"]):
            result = self.succeed(*command, "--quiet", "--progress")
            self.assertEqual((result.stdout, result.stderr), ("", ""))

    def test_progress_without_a_terminal_is_plain_lines(self):
        for command in (["ptcverify", self.scene], ["ptcbuild", self.cloud, "-o", self.here / "o.ptcx"],
                        ["ptcshade", self.scene, "-o", self.here / "o.ply"]):
            text = self.succeed(*command, "--progress").stderr
            self.assertGreaterEqual(len(text.splitlines()), 2)
            self.assertNotIn("\r", text)
            self.assertEqual(self.succeed(*command).stderr, "")

    def test_a_check_against_rays_is_reported(self):
        facts = json.loads(self.succeed("ptcshade", self.scene, "-o", self.here / "o.ply", "--check", "20",
                                        "--check-rays", "64", "--json").stdout)
        self.assertGreaterEqual(facts["check"]["receivers"], 20)
        self.assertIn("occlusion_rms", facts["check"]["discs"])

    def test_pictures_are_written_in_every_layer(self):
        layers = [f"--layer={name}={self.here}/{name}.png" for name in ("direct", "indirect", "occlusion", "albedo")]
        self.succeed("ptcrender", self.box, "--mesh", self.mesh, "-o", self.here / "o.exr",
                     "-o", self.here / "o.png", *layers, *SMALL_PICTURE)
        self.assertEqual((self.here / "o.exr").read_bytes()[:4], b"\x76\x2f\x31\x01")
        for name in ("o", "direct", "indirect", "occlusion", "albedo"):
            png = (self.here / (name + ".png")).read_bytes()
            self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
            self.assertEqual(struct.unpack(">II", png[16:24]), (24, 16))


class Verify(ProgramTest):
    def test_whole_containers_are_valid(self):
        self.assertIn("valid", self.succeed("ptcverify", self.scene).stdout)
        self.assertIn("valid", self.succeed("ptcverify", self.box, "--threads", "1").stdout)

    def test_a_flipped_byte_is_named_by_offset_and_rule(self):
        whole = self.scene.read_bytes()
        path = self.here / "flipped.ptcx"
        for offset in range(50, len(whole), 1777):
            flipped = bytearray(whole)
            flipped[offset] ^= 0x40
            path.write_bytes(flipped)
            message = self.fail_with(1, "ptcverify", path)
            self.assertRegex(message, rf"{path}: offset \d+: .+ \(spec/[a-z]+\.md#[a-z0-9-]+\)")


class Determinism(ProgramTest):
    def test_threads_and_caps_do_not_change_what_is_written(self):
        for program, operands, name in (("ptcbuild", [self.mesh, "--points", "4k"], "o.ptcx"),
                                        ("ptcshade", [self.scene], "o.ptcx"),
                                        ("ptcshade", [self.scene], "o.ply")):
            first = None
            for options in (["--threads", "1"], ["--threads", "2"], ["--threads", "5"],
                            ["--memory", "128M"], ["--temp", str(self.here)]):
                self.succeed(program, *operands, *options, "-o", self.here / name)
                data = (self.here / name).read_bytes()
                first = first or data
                self.assertEqual(data, first, options)


if __name__ == "__main__":
    unittest.main()
