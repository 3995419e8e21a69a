"""tools/measure.sh: every file of spec/results has one command, and each command writes its file."""

import os
import re
import subprocess
import unittest
from pathlib import Path

from programs import BIN, ProgramTest

ROOT = Path(__file__).resolve().parent.parent.parent
SCRIPT = ROOT / "tools/measure.sh"


def listed():
    """Returns the names of results and their commands, as the script lists them."""
    done = subprocess.run([SCRIPT, "--list"], capture_output=True, text=True, check=True, timeout=60)
    return dict(line.split(": ", 1) for line in done.stdout.splitlines())


class Measure(ProgramTest):
    def test_the_list_of_results_names_every_file_with_its_command(self):
        text = (ROOT / "spec/results/README.md").read_text()
        rows = dict(re.findall(r"^\| `([a-z0-9-]+)\.md` \| `(ptcbench [^`]+)` \|", text, re.MULTILINE))
        self.assertEqual(rows, listed())

    def test_results_that_are_there_are_in_the_list(self):
        names = {path.stem for path in (ROOT / "spec/results").glob("*.md")} - {"README"}
        others = {"scenes", "farm-slurm", "farm-slurm-bounces"}  # tools/scenes.py and tests/farm/slurm_run.py write these
        self.assertLessEqual(names - others, set(listed()))

    def test_every_experiment_writes_a_result(self):
        help_text = self.succeed("ptcbench", "--help").stdout
        experiments = set(re.findall(r"^  ([a-z]+)  ", help_text.split("Commands:")[1], re.MULTILINE))
        self.assertEqual({command.split()[1] for command in listed().values()}, experiments)

    def test_each_command_works_and_writes_its_file(self):
        results = self.here / "results"
        done = subprocess.run([SCRIPT, "--quick", "--bin", BIN, "--work", self.here / "work", "--results", results,
                               self.mesh], capture_output=True, text=True, timeout=580)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({path.stem for path in results.glob("*.md")}, set(listed()))
        for path in results.glob("*.md"):
            text = path.read_text()
            self.assertRegex(text, r"^# .+\n\n.+\n\n", path.name)
            for fact in ("machine", "instructions", "system", "load before", "commit", "date", "command", "runs"):
                self.assertRegex(text, rf"\n\| {fact} \| \S.* \|\n", path.name)
            self.assertIn(f"--name {path.stem} ", text)
            self.assertGreater(len(re.findall(r"^\|[-:|]+\|$", text, re.MULTILINE)), 1, path.name)
            for chart in re.findall(r"\(([^)]+\.(?:svg|png))\)", text):
                self.assertTrue((results / chart).is_file(), chart)
            for private in (str(self.here), os.uname().nodename + " ", " nan", "inf "):
                self.assertNotIn(private, text, path.name)

    def test_a_mesh_that_is_not_there_is_told_before_anything_runs(self):
        for arguments in ([], [self.here / "none.ply"], ["--quik", self.mesh]):
            done = subprocess.run([SCRIPT, "--results", self.here / "results", *arguments], capture_output=True,
                                  text=True, timeout=60)
            self.assertEqual(done.returncode, 2)
            self.assertTrue(done.stderr.startswith("measure.sh: "))
            self.assertFalse((self.here / "results").exists())

    def test_a_name_or_a_value_that_is_missing_is_a_usage_error(self):
        for arguments, text in ((["--only", "no-such-result", self.mesh], "there is no result 'no-such-result'"),
                                (["--only", "", self.mesh, "--only"], "--only needs a value"),
                                (["--bin"], "--bin needs a value"), ([self.mesh, "--work"], "--work needs a value"),
                                ([self.mesh, "--results"], "--results needs a value")):
            done = subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, timeout=60)
            self.assertEqual((done.returncode, done.stdout), (2, ""), arguments)
            self.assertIn("measure.sh: " + text, done.stderr)


if __name__ == "__main__":
    unittest.main()
