"""A program of version 1.0 does with files of a later 1.x what spec/versions.md says.

The files are vectors: pages, channels, roles, texts and feature bits that 1.0 does not know.
"""

import sys
import unittest
from pathlib import Path

from programs import SMALL_PICTURE, ProgramTest, run

SPEC = Path(__file__).resolve().parents[2] / "spec"
sys.path.insert(0, str(SPEC))
import reader  # noqa: E402

GOOD, BAD = SPEC / "vectors" / "good", SPEC / "vectors" / "bad"
PAGES = GOOD / "pages-of-a-later-version.ptcx"
HINTS = GOOD / "unknown-compatible-features.ptcx"
READ_ONLY = GOOD / "unknown-read-only-features.ptcx"
MINOR = GOOD / "newer-minor-version.ptcx"
NEEDED = BAD / "container-header-features.ptcx"


def facts(path):
    """Returns types of the pages, rows of the schema and texts of a container."""
    container = reader.open_container(str(path))
    types = [entry.type for entry in container.entries]
    channels, texts = container.meta.channels, container.meta.text
    container.close()
    return types, channels, texts


class Later(ProgramTest):
    def read_by_all(self, path):
        """Lets every program read a file that it need not copy."""
        self.succeed("ptcinfo", path)
        self.succeed("ptcverify", path, "--level", "4")
        self.succeed("ptcconvert", path, self.here / "points.ply")
        self.succeed("ptcshade", path, "-o", self.here / "shaded.ply")
        self.succeed("ptcrender", path, "-o", self.here / "picture.png", *SMALL_PICTURE)

    def test_what_a_later_version_adds_is_read_past(self):
        for path in (PAGES, HINTS, READ_ONLY, MINOR):
            with self.subTest(path.name):
                self.read_by_all(path)

    def test_a_copy_page_by_page_keeps_pages_channels_and_texts(self):
        types, channels, texts = facts(PAGES)
        self.assertEqual([t for t in types if t >= 128], [128, 128, 255])
        self.assertIn("later.key", texts)
        copy = self.here / "copy.ptcx"
        self.succeed("ptcconvert", PAGES, copy, "--profile", "raw")
        self.assertEqual(facts(copy), (types, channels, texts))
        self.succeed("ptcverify", copy, "--level", "4")

    def test_what_builds_the_points_anew_leaves_pages_out_and_keeps_the_rest(self):
        types, channels, texts = facts(PAGES)
        built = self.here / "built.ptcx"
        for command in (["ptcconvert", PAGES, built, "--page-size", "8K"], ["ptcverify", PAGES, "--salvage", built]):
            with self.subTest(command[0]):
                self.succeed(*command)
                now_types, now_channels, now_texts = facts(built)
                self.assertFalse([t for t in now_types if t >= 128])
                self.assertEqual(now_channels, channels)
                self.assertEqual({k: v for k, v in now_texts.items() if k in texts}, texts)

    def test_a_file_that_may_only_be_read_is_not_copied_extended_or_repaired(self):
        target = self.here / "copy.ptcx"
        for command in (["ptcconvert", READ_ONLY, target], ["ptcshade", READ_ONLY, "-o", target],
                        ["ptcbuild", self.cloud, "--append", READ_ONLY, "-o", target],
                        ["ptcverify", READ_ONLY, "--salvage", target]):
            with self.subTest(command[0]):
                done = run(*command)
                self.assertEqual((done.returncode, target.exists()), (4, False), done.stderr)
                errors = done.stderr
                self.assertIn("offset 24: only a program that knows bits 0, 1, ", errors)
                self.assertIn("spec/versions.md#features", errors)

    def test_a_file_that_needs_an_unknown_feature_is_refused_by_its_bit(self):
        target = self.here / "out.ptcx"
        for command in (["ptcinfo", NEEDED], ["ptcverify", NEEDED], ["ptcverify", NEEDED, "--salvage", target],
                        ["ptcconvert", NEEDED, self.here / "out.ply"], ["ptcshade", NEEDED, "-o", target],
                        ["ptcrender", NEEDED, "-o", self.here / "out.png", *SMALL_PICTURE],
                        ["ptcbuild", self.cloud, "--append", NEEDED, "-o", target]):
            with self.subTest(command[:1] + command[2:3]):
                errors = self.fail_with(4, *command)
                self.assertRegex(errors, r"a feature that this program does not know: bit \d+ of feature_incompat")
                self.assertNotIn("neither the header nor", errors)


if __name__ == "__main__":
    unittest.main()
