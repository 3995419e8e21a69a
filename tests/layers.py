"""Reads every #include "..." of the sources against the table in tools/cmake/PtcLayers.cmake, and
every string literal of the library for words that are the programs' own.

A file may include its own layer and those that the table names, always by the path from the root of
the tree. Every package that the project requires is linked by some target. The library names no
option of a command line: its messages name fields of requests in backquotes, for which
tools/field_names.cpp has the options. Needs the standard library only.
"""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ["format", "engine", "tools"]


def read_table(text):
    """Returns the layers that each layer may include, from set(PTC_LAYERS_x "a;b") lines."""
    table = {}
    for layer, value in re.findall(r'^set\(PTC_LAYERS_(\S+)\s+"([^"]*)"\)', text, re.MULTILINE):
        value = re.sub(r"\$\{PTC_LAYERS_([^}]+)\}", lambda m: ";".join(table[m[1]]), value)
        table[layer] = [name for name in value.split(";") if name]
    return table


def layer_of(path, table):
    """Returns the layer whose folder holds a path from the root; None for a file in no layer."""
    folder = Path(path).parent
    while str(folder) != "." and str(folder) not in table:
        folder = folder.parent
    return str(folder) if str(folder) in table else None


def faults_of(path, text, table, exists):
    """Returns what is wrong with the includes of one file, "PATH:LINE: ..." each."""
    own = layer_of(path, table)
    faults = []
    for number, line in enumerate(text.splitlines(), 1):
        found = re.match(r'\s*#\s*include\s*(["<])([^">]+)[">]', line)
        if not found:
            continue
        quote, target = found.groups()
        place = f"{path}:{number}: "
        layer = layer_of(target, table)
        if ".." in Path(target).parts:
            faults.append(place + f"{target} leads out of its folder")
        elif quote == "<":
            if layer:
                faults.append(place + f"<{target}> is ours and belongs in quotes")
        elif not exists(target):
            faults.append(place + f"{target} is no path from the root of the tree")
        elif layer != own and layer not in table[own]:
            faults.append(place + f"{own} may not include {layer} ({target})")
    return faults


def packages_not_linked(root_list, other_lists):
    """Returns packages that the CMakeLists.txt at the root requires and that no target links."""
    required = re.findall(r"^\s*find_package\((\w+) [^)]*\bCONFIG\b", root_list, re.MULTILINE)
    required += re.findall(r"^\s*pkg_check_modules\((\w+)", root_list, re.MULTILINE)
    words = set(re.split(r"[\s():,<>$]+", " ".join(other_lists)))
    return [name for name in required if name not in words]


TOKEN = re.compile(r'''//[^\n]*|/\*.*?\*/|R"(?P<mark>[^(\s]*)\((?P<raw>.*?)\)(?P=mark)"|"(?P<text>(?:[^"\\\n]|\\.)*)"'''
                   r"|'(?:[^'\\\n]|\\.)+'(?!\w)|(?P<code>[^\s])", re.S)


def literals_of(text):
    """Returns the string literals of a source with their lines; adjacent ones are joined, as by the compiler."""
    found, joined = [], False
    for token in TOKEN.finditer(text):
        if token["code"]:
            joined = False
        elif token["text"] is not None or token["raw"] is not None:
            content = token["text"] if token["text"] is not None else token["raw"]
            if joined:
                found[-1] = (found[-1][0], found[-1][1] + content)
            else:
                found.append((text.count("\n", 0, token.start()) + 1, content))
            joined = True
    return found


def word_faults_of(path, text, fields):
    """Returns literals that name a command-line option, or a field in backquotes for which no program has an option."""
    faults = []
    for line, literal in literals_of(text):
        if re.search(r"--[a-z]", literal):
            faults.append(f"{path}:{line}: an option of a command line: {literal}")
        for field in re.findall(r"`([a-z_.]+)`", literal):
            if field not in fields:
                faults.append(f"{path}:{line}: tools/field_names.cpp does not know `{field}`")
    return faults


class Headers(unittest.TestCase):
    def test_a_source_begins_with_the_header_of_its_name(self):
        # So each header is compiled alone
        faults, checked = [], 0
        for folder in FOLDERS:
            for source in sorted((ROOT / folder).rglob("*.cpp")):
                header = source.with_suffix(".h").relative_to(ROOT).as_posix()
                if not (ROOT / header).exists():
                    continue
                checked += 1
                first = re.search(r'^#include ["<]([^">]+)', source.read_text(), re.MULTILINE)
                if not first or first[1] != header:
                    faults.append(header)
        self.assertEqual(faults, [])
        self.assertGreater(checked, 100)


class Words(unittest.TestCase):
    FIELDS = set(re.findall(r'FieldName\{"([^"]+)", "--[a-z-]+"\}', (ROOT / "tools/field_names.cpp").read_text()))

    def test_the_library_names_fields_and_no_options(self):
        faults, literals = [], 0
        for folder in ["format", "engine"]:
            for path in sorted((ROOT / folder).rglob("*")):
                if path.suffix in (".h", ".cpp"):
                    text = path.read_text()
                    literals += len(literals_of(text))
                    faults += word_faults_of(path.relative_to(ROOT).as_posix(), text, self.FIELDS)
        self.assertEqual(faults, [])
        self.assertGreater(literals, 1000)
        self.assertGreater(len(self.FIELDS), 20)

    def test_options_and_unknown_fields_are_found(self):
        for source in ('f("use --salvage");', 'f("a " // --b\n  "-"\n "-salvage");', 'f(R"(--x)");', "g('\"'); f(\"--x\");",
                       'f("`no_such_field`");', 'f("`sampling."\n  "spacings`");'):
            self.assertEqual(len(word_faults_of("a.cpp", source, {"sampling.spacing"})), 1, source)
        for source in ('// "--salvage"', 'f(a[0]--, --b);', 'f("--", "salvage");', '/* "--x" */', "f(a--b, '-');",
                       'f("`sampling." "spacing` and 1\'000 --- or - -x");', "g(1'000); f(\"--1\"); // \"--x\""):
            self.assertEqual(word_faults_of("a.cpp", source, {"sampling.spacing"}), [], source)


class Layers(unittest.TestCase):
    def setUp(self):
        self.table = read_table((ROOT / "tools/cmake/PtcLayers.cmake").read_text())

    def test_every_include_keeps_to_the_table(self):
        faults, files = [], 0
        for folder in FOLDERS:
            for path in sorted((ROOT / folder).rglob("*")):
                if path.suffix not in (".h", ".cpp"):
                    continue
                files += 1
                name = path.relative_to(ROOT).as_posix()
                self.assertIsNotNone(layer_of(name, self.table), f"{name} is in no layer")
                faults += faults_of(name, path.read_text(), self.table, lambda p: (ROOT / p).is_file())
        self.assertEqual(faults, [])
        self.assertGreater(files, 50)

    def test_the_table_has_no_circles(self):
        for layer, allowed in self.table.items():
            for other in allowed:
                if other != layer:
                    self.assertNotIn(layer, self.table[other], f"{layer} and {other}")

    def test_every_package_that_is_required_is_linked(self):
        root_list = (ROOT / "CMakeLists.txt").read_text()
        others = [path.read_text() for folder in FOLDERS + ["tests", "fuzz"]
                  for pattern in ("CMakeLists.txt", "*.cmake") for path in (ROOT / folder).rglob(pattern)]
        self.assertEqual(packages_not_linked(root_list, others), [])
        self.assertGreater(len(packages_not_linked(root_list, [])), 10)
        self.assertEqual(packages_not_linked("find_package(one CONFIG REQUIRED)\nfind_package(two 3 CONFIG)\n"
                                             "  pkg_check_modules(three REQUIRED three)", ["two::two", "threes"]),
                         ["one", "three"])

    def test_what_the_table_forbids_is_found(self):
        def faults(path, line):
            return faults_of(path, "#pragma once\n" + line, self.table, lambda p: "missing" not in p)

        self.assertEqual(faults("engine/octree/a.cpp", '#include "engine/sort/b.h"'), [])
        self.assertEqual(faults("engine/octree/a.cpp", '#include "engine/octree/b.h"'), [])
        self.assertEqual(faults("engine/octree/a.cpp", "#include <vector>"), [])
        self.assertEqual(faults("tools/a.cpp", '#include "engine/shade/b.h"'), [])
        self.assertEqual(faults("tools/a.cpp", '#include "tools/bench/chart/b.h"'), [])
        for path, line in (("engine/octree/a.cpp", '#include "engine/shade/b.h"'),
                           ("engine/shade/a.cpp", '#  include "engine/octree/b.h"'),
                           ("format/a.h", '#include "engine/base/b.h"'),
                           ("engine/io/a.h", '#include "engine/ptc.h"'),
                           ("engine/pipeline/a.h", '#include "tools/b.h"'),
                           ("tools/a.cpp", '#include "tools/bench/experiments/b.h"'),
                           ("tools/bench/chart/a.cpp", '#include "engine/shade/b.h"'),
                           ("tools/bench/references/a.h", '#include "tools/bench/report/b.h"'),
                           ("engine/io/a.h", '#include "../base/b.h"'),
                           ("engine/io/a.h", '#include "missing.h"'),
                           ("engine/io/a.h", "#include <format/b.h>")):
            self.assertEqual(len(faults(path, line)), 1, (path, line))


if __name__ == "__main__":
    unittest.main()
