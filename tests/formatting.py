"""Checks every C++ file against .clang-format, with the release of clang-format that Debian 12 has.

Another release may break lines elsewhere, so the test is skipped (exit code 77) where that one is
not installed. With --fix the files are rewritten instead.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ["format", "engine", "tools", "tests", "fuzz"]
RELEASE = 14
SKIPPED = 77


def find_clang_format():
    """Returns the path of clang-format in the required release, or None."""
    for name in (f"clang-format-{RELEASE}", "clang-format"):
        path = shutil.which(name)
        if not path:
            continue
        version = subprocess.run([path, "--version"], capture_output=True, text=True, check=True)
        if re.search(rf"version {RELEASE}\.", version.stdout):
            return path
    return None


def sources():
    """Returns all C++ files of the tree."""
    return [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*"))
            if path.suffix in (".h", ".cpp")]


def faults_of(program, paths):
    """Returns what clang-format would change, one line for each place; empty when a file is formatted."""
    done = subprocess.run([program, "--dry-run", "--Werror", "--style=file", *map(str, paths)],
                          capture_output=True, text=True, check=False)
    places = [line for line in done.stderr.splitlines() if "error:" in line]
    return places if done.returncode else []


class Formatting(unittest.TestCase):
    program = None

    def test_every_source_is_formatted(self):
        paths = sources()
        self.assertGreater(len(paths), 300)
        self.assertEqual(faults_of(self.program, paths), [], "tests/formatting.py --fix mends it")

    def test_a_line_in_another_style_is_found(self):
        with tempfile.TemporaryDirectory(dir=ROOT / "tests") as folder:
            path = Path(folder) / "other_style.cpp"
            path.write_text("int  main( ) { return 0 ; }\n")
            self.assertTrue(faults_of(self.program, [path]))


if __name__ == "__main__":
    Formatting.program = find_clang_format()
    if not Formatting.program:
        print(f"skipped: clang-format {RELEASE} is not installed")
        sys.exit(SKIPPED)
    if sys.argv[1:] == ["--fix"]:
        sys.exit(subprocess.run([Formatting.program, "-i", *map(str, sources())], check=False).returncode)
    unittest.main()
