"""Guide: every command of spec/guide and of the README does what its page says.

Lines of ```sh blocks are run in the order of the page, in a directory with the four files that
spec/guide/README.md names. A line that ends in `# exit code N` has to end with N, any other with 0.
Lines of ```text blocks are messages: the commands of the page have to print them, with numbers of
their own.
"""

import math
import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

from programs import BIN, BOX, PROGRAMS, ball, write_ply
from range_server import RangeServer

ROOT = Path(__file__).resolve().parents[2]
GUIDE = ROOT / "spec" / "guide"
BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.M | re.S)
MESSAGES = re.compile(r"^```text\n(.*?)^```$", re.M | re.S)
CODE = re.compile(r"# exit code (\d+)\b")


def commands(text):
    """Command lines of the ```sh blocks, each with the exit code that the page states."""
    for block in BLOCK.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            stated = CODE.search(line)
            if line.split("#")[0].strip():
                yield line, int(stated[1]) if stated else 0


def without_numbers(text):
    return re.sub(r"\d+(\.\d+)?", "N", text)


def write_torus(path, around=48, across=24):
    """An ASCII PLY mesh of quads that stands on the plane y = 0.1."""
    points, faces = [], []
    for i in range(around):
        for j in range(across):
            a, b = 2 * math.pi * i / around, 2 * math.pi * j / across
            ring = 1 + 0.4 * math.cos(b)
            points.append((ring * math.cos(a), 0.5 + 0.4 * math.sin(b), ring * math.sin(a)))
            k, m = (i + 1) % around, (j + 1) % across
            faces.append((i * across + j, i * across + m, k * across + m, k * across + j))
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = ["%.6g %.6g %.6g" % point for point in points]
    rows += ["4 %d %d %d %d" % face for face in faces]
    path.write_text("\n".join(header + rows) + "\n")


def write_inputs(folder):
    """The files with which every page begins."""
    write_torus(folder / "statue.ply")
    # Texture coordinates give the floor the left half of a texture, and the wall the right one.
    (folder / "room.obj").write_text(
        re.sub(r"^f.*\n", "", BOX, flags=re.M) + "vt 0.02 0.02\nvt 0.48 0.02\nvt 0.48 0.98\nvt 0.02 0.98\n"
        "vt 0.52 0.02\nvt 0.98 0.02\nvt 0.98 0.98\nvt 0.52 0.98\nf 4/4 3/3 2/2 1/1\nf 1/5 2/6 6/7 5/8\n")
    points = ball(4000)
    names = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"]
    write_ply(folder / "scan.ply", [point[:6] + point[10:] for point in points], names)
    lines = ["%.6g %.6g %.6g" % point[:3] for point in points]
    (folder / "bare.xyz").write_text("\n".join(lines) + "\n")


class GuideTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory(prefix="ptc-guide-")
        self.addCleanup(self.scratch.cleanup)
        self.here = Path(self.scratch.name)
        write_inputs(self.here)

    def run_page(self, text, **variables):
        """Writes the files that a page shows, and runs its commands; returns how many there are."""
        for name, content in re.findall(r"^```json (\S+)\n(.*?)^```", text, re.M | re.S):
            (self.here / name).write_text(content)
        environment = dict(os.environ, PATH=f"{BIN}:{os.environ['PATH']}", **variables)
        count, printed = 0, ""
        for line, code in commands(text):
            ran = subprocess.run(["bash", "-c", line], cwd=self.here, env=environment,
                                 capture_output=True, text=True, timeout=120)
            self.assertEqual(ran.returncode, code, f"{line}\n{ran.stdout}{ran.stderr}")
            count, printed = count + 1, printed + ran.stdout + ran.stderr
        for block in MESSAGES.findall(text):
            for message in block.splitlines():
                self.assertIn(without_numbers(message), without_numbers(printed))
        return count

    def write_broken(self, path):
        """Writes a container one of whose pages of points is damaged."""
        subprocess.run([BIN / "ptcbuild", self.here / "statue.ply", "--points", "20k", "-o", path, "--quiet"], check=True,
                       timeout=120)
        data = bytearray(path.read_bytes())
        data[100000] ^= 0xFF
        path.write_bytes(data)

    def test_every_program_has_a_page(self):
        guide = "".join(page.read_text() for page in GUIDE.glob("*.md"))
        used = {line.split()[0] for line, _ in commands(guide)}
        for program in PROGRAMS:
            self.assertIn(program, used)

    def test_the_index_lists_every_page(self):
        index = (GUIDE / "README.md").read_text()
        for page in GUIDE.glob("*.md"):
            if page.name != "README.md":
                self.assertIn(f"]({page.name})", index)

    def test_the_extents_of_the_files_are_those_that_the_guide_states(self):
        stated = dict(re.findall(r"^\| `(\S+)` \| (.*) \|$", (GUIDE / "README.md").read_text(), re.M))
        for mesh, low, high in (("statue.ply", "-1.4 0.1 -1.4", "1.4 0.9 1.4"), ("room.obj", "0 0 0", "1 1 1"),
                                ("scan.ply", "-1 -1 -1", "1 1 1")):
            for number in {*low.split(), *high.split()}:
                self.assertRegex(stated[mesh], rf" {re.escape(number)}\b")
            made = subprocess.run([str(BIN / "ptcbuild"), mesh, "--points", "20k", "-o", "o.ptcx"], cwd=self.here)
            self.assertEqual(made.returncode, 0)
            told = subprocess.run([str(BIN / "ptcinfo"), "o.ptcx"], cwd=self.here, capture_output=True, text=True).stdout
            found = [float(word) for word in re.search(r"bounds +(.*)\n", told)[1].replace(" to", "").split()]
            for value, wanted in zip(found, map(float, f"{low} {high}".split())):
                self.assertAlmostEqual(value, wanted, delta=0.05)

    def test_a_page_that_is_wrong_is_noticed(self):
        with self.assertRaises(AssertionError):
            self.run_page("```sh\nptcverify scan.ply\n```\n")
        stated = "```sh\nptcverify scan.ply  # exit code 1\n```\n"
        self.assertEqual(self.run_page(stated), 1)
        with self.assertRaises(AssertionError):
            self.run_page(stated + "```text\nptcverify: scan.ply is a container\n```\n")

    def test_readme(self):
        """The README's commands, with small counts and small pictures."""
        text = (ROOT / "README.md").read_text()
        text = re.sub(r"\b\d+M\b(?= --memory)|(?<=--points )\d+M", "20k", text)
        text = text.replace("ptcrender ", "ptcrender --size 96x54 ")
        self.write_broken(self.here / "broken.ptcx")
        self.assertGreater(self.run_page(text, mesh="statue.ply"), 9)


    def test_remote(self):
        """The page has its scene on a server, which is one of this machine here."""
        made = subprocess.run([BIN / "ptcbuild", "--city", "20k", "-o", self.here / "city.ptcx", "--quiet"], timeout=120)
        self.assertEqual(made.returncode, 0)
        with RangeServer(self.here) as server:
            page = (GUIDE / "remote.md").read_text()
            self.assertGreater(self.run_page(page, server=server.url, no_proxy="127.0.0.1"), 3)


def add_page(page):
    @unittest.skipIf(page.stem == "measure" and "ptcbench" not in PROGRAMS, "without ptcbench")
    def test(self):
        self.assertGreater(self.run_page(page.read_text()), 0)

    setattr(GuideTest, f"test_{page.stem}", test)


for found in sorted(GUIDE.glob("*.md")):
    if found.name not in ("README.md", "remote.md"):
        add_page(found)

if __name__ == "__main__":
    unittest.main()
