"""Help, man pages and completions of shells, which every program writes from its declared options.

man, mandoc, zsh and fish are asked where they are installed; the tests that need them are skipped
elsewhere, and say so.
"""

import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from programs import BIN, PROGRAMS, run

KINDS = ("man", "bash", "zsh", "fish")
PLACES = {"man": "man/man1/{}.1", "bash": "bash-completion/completions/{}",
          "zsh": "zsh/site-functions/_{}", "fish": "fish/vendor_completions.d/{}.fish"}
WIDTH = 100


def text_of(program, *arguments):
    done = run(program, *arguments)
    assert done.returncode == 0 and not done.stderr, (program, arguments, done.stderr)
    return done.stdout


def commands_of(program):
    """Names of the commands in the help of a program; none of most programs."""
    found = re.search(r"\nCommands:\n(.*?)\n\n", text_of(program, "--help"), re.DOTALL)
    return re.findall(r"^  ([a-z]+)  ", found[1], re.MULTILINE) if found else []


def helps_of(program):
    """The help of a program and those of its commands."""
    return [text_of(program, "--help")] + [text_of(program, name, "--help") for name in commands_of(program)]


def entries_of(help_text):
    """Names and text of each option in a help, as "-o, --output FILE" and the lines behind it."""
    body = help_text.split("\nExamples:\n")[0]
    return re.findall(r"^  (?:    )?(-[^ ]+(?:, --[^ ]+)?(?: [^ ]+)?)((?:  +|\n {10,})\S.*(?:\n {10,}\S.*)*)",
                      body, re.MULTILINE)


def options_of(help_text):
    """Every name of an option in a help."""
    return [name for label, _ in entries_of(help_text) for name in re.findall(r"(?<!\S)--?[a-z][a-z-]*", label)]


def complete(program, *words, here=None):
    """What bash proposes for the last of these words."""
    script = """
source "$1"; shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _"$1"
[[ ${#COMPREPLY[@]} -eq 0 ]] || printf '%s\\n' "${COMPREPLY[@]}"
"""
    with tempfile.NamedTemporaryFile("w", suffix=".bash") as file:
        file.write(text_of(program, "--generate", "bash"))
        file.flush()
        done = subprocess.run(["bash", "-c", script, "bash", file.name, program, *words], cwd=here,
                              capture_output=True, text=True, timeout=60, check=False)
    assert not done.stderr, done.stderr
    return done.stdout.split("\n")[:-1]


class Help(unittest.TestCase):
    def test_a_help_is_summary_usage_groups_and_examples_in_lines_that_fit(self):
        for program in PROGRAMS:
            for text in helps_of(program):
                lines = text.splitlines()
                self.assertRegex(lines[0], r"^[A-Z]")
                self.assertRegex(text, rf"\n\nUsage: {program} ")
                self.assertLess(text.index("Usage: "), text.index("\nGeneral:\n"))
                self.assertEqual([line for line in lines if len(line) > WIDTH], [], program)
                self.assertNotIn("Exit codes", text)

    def test_most_options_of_a_help_take_one_line(self):
        for program in PROGRAMS:
            if program == "ptcbench":
                continue
            entries = entries_of(text_of(program, "--help"))
            self.assertGreater(len(entries), 7)
            self.assertEqual([label for label, text in entries if "\n" in text], [], program)

    def test_words_for_values_with_suffixes_or_units_are_explained(self):
        for program in PROGRAMS:
            for text in helps_of(program):
                for word in ("COUNT", "SIZE", "LIGHT"):
                    used = re.search(rf"^ +--.*\b{word}(  |$)", text, re.MULTILINE) is not None
                    self.assertEqual(used, f"\n{word} " in text, (program, word))

    def test_expert_options_come_last_and_the_others_before_what_all_programs_share(self):
        for program in PROGRAMS:
            for text in helps_of(program):
                titles = re.findall(r"^(\w[\w ]*):$", text.split("\nExamples:\n")[0], re.MULTILINE)
                expected = ["General"] + (["Expert"] if "Expert" in titles else [])
                self.assertEqual(titles[-len(expected):], expected, program)

    def test_what_generates_manuals_is_hidden_and_refuses_other_kinds(self):
        for program in PROGRAMS:
            for text in helps_of(program) + [text_of(program, "--generate", kind) for kind in KINDS]:
                self.assertNotIn("--generate", re.sub(r"written by: .*", "", text))
            done = run(program, "--generate", "csh")
            self.assertEqual(done.returncode, 2)
            self.assertIn("expects man, bash, zsh or fish, not 'csh'", done.stderr)


class Manuals(unittest.TestCase):
    def test_every_option_of_a_help_is_in_the_man_page_and_in_the_completions(self):
        for program in PROGRAMS:
            names = {name for text in helps_of(program) for name in options_of(text)}
            self.assertTrue({"--memory", "--help", "-h"} <= names, names)
            texts = {kind: text_of(program, "--generate", kind) for kind in KINDS}
            for name in names:
                bare = name.lstrip("-")
                patterns = {"man": re.escape(r"\fB" + name.replace("-", r"\-") + r"\fR"),
                            "bash": rf"(?<![\w-]){name}(?![\w-])", "zsh": rf"(?<![\w-]){name}[=+]?\[",
                            "fish": rf" -{'l' if name.startswith('--') else 's'} {bare} "}
                for kind in KINDS:
                    self.assertRegex(texts[kind], patterns[kind], (program, kind))

    def test_a_man_page_has_every_section_and_every_exit_code(self):
        errors = (Path(__file__).resolve().parents[2] / "spec/errors.md").read_text()
        known = set(re.findall(r"^\| (\d) \|", errors.split("## Exit codes")[1].split("## ")[0], re.MULTILINE))
        for program in PROGRAMS:
            page = text_of(program, "--generate", "man")
            sections = ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXIT STATUS", "EXAMPLES", "SEE ALSO"]
            if program == "ptcbench":
                sections.insert(3, "COMMANDS")
            self.assertEqual(re.findall(r"^\.SH (.*)$", page, re.MULTILINE), sections)
            codes = set(re.findall(r"^\\fB(\d)\\fR$", page.split(".SH EXIT STATUS")[1], re.MULTILINE))
            self.assertEqual(codes, known if program == "ptcverify" else known - {"6"})
            others = set(re.findall(r"^\.BR (\S+) \(1\)", page.split(".SH SEE ALSO")[1], re.MULTILINE))
            self.assertEqual(others, set(PROGRAMS) - {program, "ptcbench"})  # ptcbench is not installed

    def test_a_man_page_bears_the_version_and_no_date_of_the_build(self):
        version = text_of("ptcinfo", "--version").split()[1]
        heads = {text_of(program, "--generate", "man").splitlines()[0].split(" ", 2)[2] for program in PROGRAMS}
        self.assertEqual(len(heads), 1)
        self.assertRegex(heads.pop(), rf'^1 \d{{4}}-\d\d-\d\d "PTCX {re.escape(version)}" "PTCX Manual"$')
        for program in PROGRAMS:
            for kind in KINDS:
                self.assertEqual(text_of(program, "--generate", kind), text_of(program, "--generate", kind))

    def test_the_build_writes_what_the_programs_say(self):
        share = BIN.parent / "share"
        if not share.is_dir():
            self.skipTest("ptc_manuals is not built")
        for program in PROGRAMS:
            for kind in KINDS:
                path = share / PLACES[kind].format(program)
                self.assertEqual(path.read_text(), text_of(program, "--generate", kind), path)

    def check_each(self, kind, tool, *command, environment=None):
        """Runs a tool on the text of each program, and expects that it has nothing to say."""
        if not shutil.which(tool):
            self.skipTest(f"{tool} is not installed")
        for program in PROGRAMS:
            with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
                file.write(text_of(program, "--generate", kind))
                file.flush()
                done = subprocess.run([tool, *command, file.name], capture_output=True, text=True, timeout=60,
                                      env=environment, check=False)
            said = done.stderr + (done.stdout if tool == "mandoc" else "")
            self.assertEqual((done.returncode, said), (0, ""), program)

    def test_man_prints_every_page_without_a_warning(self):
        self.check_each("man", "man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z")

    def test_mandoc_finds_nothing_in_any_page(self):
        self.check_each("man", "mandoc", "-Tlint")

    def test_bash_parses_every_completion(self):
        self.check_each("bash", "bash", "-n")

    def test_zsh_parses_every_completion(self):
        self.check_each("zsh", "zsh", "-n")

    def test_zsh_takes_no_ending_for_a_qualifier(self):
        for program in PROGRAMS:
            self.assertNotRegex(text_of(program, "--generate", "zsh"), r"\*\.\([^|)]*\)")

    def test_fish_parses_every_completion(self):
        self.check_each("fish", "fish", "-n")


class Completions(unittest.TestCase):
    def test_bash_proposes_options_after_a_dash(self):
        self.assertEqual(complete("ptcbuild", "--pro"), ["--profile", "--progress"])
        for program in PROGRAMS:
            self.assertEqual(complete(program, "--mem"), ["--memory"])
            self.assertEqual(complete(program, "--gen"), [])

    def test_bash_proposes_the_words_that_an_option_takes(self):
        words = ["raw", "exact", "fast", "compact"]
        self.assertEqual(complete("ptcbuild", "--profile", ""), words)
        self.assertEqual(complete("ptcbuild", "--profile", "=", "c"), ["compact"])
        self.assertEqual(complete("ptcbuild", "--profile", "="), words)
        self.assertEqual(complete("ptcbuild", "--page-size", "1"), ["16K", "128K", "1M"])
        self.assertEqual(complete("ptcrender", "--layer", "oc"), ["occlusion="])
        self.assertEqual(complete("ptcbuild", "--points", ""), [])

    def test_bash_proposes_files_with_endings_that_fit_and_directories(self):
        with tempfile.TemporaryDirectory() as here:
            for name in ("a b.ptcx", "cloud.ply", "cloud.xyz", "mesh.ply.gz", "notes.doc", "picture.png"):
                (Path(here) / name).touch()
            (Path(here) / "folder").mkdir()
            for program, words, expected in (
                    ("ptcverify", [""], ["a b.ptcx"]),
                    ("ptcinfo", [""], ["a b.ptcx", "cloud.ply", "cloud.xyz", "mesh.ply.gz"]),
                    ("ptcshade", ["-o", ""], ["a b.ptcx", "cloud.ply", "cloud.xyz"]),
                    ("ptcshade", ["--receivers", "c"], ["cloud.ply", "cloud.xyz"]),
                    ("ptcbuild", ["-o", "x.ptcx", ""], ["cloud.ply", "cloud.xyz", "mesh.ply.gz"]),
                    ("ptcrender", ["--output", "=", ""], ["picture.png"]),
                    ("ptcrender", ["--layer", "occlusion", "="], ["picture.png"]),
                    ("ptcrender", ["--layer", "occlusion", "=", "p"], ["picture.png"]),
                    ("ptcrender", ["--layer", "=", "direct", "=", "p"], ["picture.png"]),
                    ("ptcverify", ["--map", ""], ["picture.png"]),
                    ("ptcbuild", ["--temp", ""], []),
                    ("ptcbuild", ["--sky", "n"], ["notes.doc"])):
                proposed = set(complete(program, *words, here=here))
                folder = {"folder"} if words[-1] in ("", "=") else set()
                self.assertEqual(proposed, set(expected) | folder, (program, words))

    def test_bash_proposes_commands_and_then_their_options(self):
        if "ptcbench" not in PROGRAMS:
            self.skipTest("ptcbench is not built")
        self.assertEqual(complete("ptcbench", "acc"), ["accuracy"])
        self.assertEqual(complete("ptcbench", ""), commands_of("ptcbench"))
        self.assertEqual(complete("ptcbench", "--checked"), [])
        self.assertEqual(complete("ptcbench", "accuracy", "--checked"), ["--checked"])
        self.assertEqual(complete("ptcbench", "mutations", "--ev"), ["--every"])

    def test_fish_proposes_options_and_words(self):
        fish = shutil.which("fish")
        if not fish:
            self.skipTest("fish is not installed")
        with tempfile.TemporaryDirectory() as home:
            path = Path(home) / "ptcbuild.fish"
            path.write_text(text_of("ptcbuild", "--generate", "fish"))
            for line, expected in (("--prof", "--profile"), ("--profile e", "exact")):
                done = subprocess.run([fish, "--no-config", "-c", f"source {path}; complete -C 'ptcbuild {line}'"],
                                      capture_output=True, text=True, timeout=60, check=False,
                                      env={"HOME": home, "PATH": "/usr/bin:/bin"})
                self.assertIn(expected, [row.split("\t")[0] for row in done.stdout.splitlines()], done.stderr)


if __name__ == "__main__":
    unittest.main()
