"""Installs the library into an empty directory, builds the examples against it as strangers would (by CMake and by
pkg-config, shared and static), and runs them.
"""

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from commands import BUILD, CMAKE, ROOT, run

EXAMPLES = ["read_points", "write_points", "build_and_shade"]
LISTS = """cmake_minimum_required(VERSION 3.25)
project(examples LANGUAGES CXX)
find_package(ptc 0.1 REQUIRED COMPONENTS {components})
foreach(example {examples})
  add_executable(${{example}} {source}/${{example}}.cpp)
  target_link_libraries(${{example}} PRIVATE {targets})
endforeach()
"""


def needed(file):
    """Libraries that a program or library names, without versions."""
    lines = run("readelf", "-d", file).splitlines()
    return {line.split("[")[1].split(".so")[0] for line in lines if "(NEEDED)" in line}


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        cls.work = pathlib.Path(cls.directory.name)
        # What a build that was stopped leaves is not installed.
        partial = BUILD / "share/bash-completion/completions/ptcbuild.partial"
        partial.touch()
        # Installed in one place and used in another: nothing may know where it was put.
        run(CMAKE, "--install", BUILD, "--prefix", cls.work / "staged")
        cls.prefix = cls.work / "prefix"
        shutil.move(cls.work / "staged", cls.prefix)
        partial.unlink()
        cls.libraries = next(cls.prefix.rglob("libptc.so")).parent
        # Without LD_LIBRARY_PATH: CMake writes the directory of libptc into a program, and libptc finds libptc-store.
        cls.environment = dict(os.environ, PKG_CONFIG_PATH=str(cls.libraries / "pkgconfig"), CMAKE_PREFIX_PATH=str(cls.prefix))
        cls.environment.pop("LD_LIBRARY_PATH", None)

    @classmethod
    def tearDownClass(cls):
        cls.directory.cleanup()

    def cmake(self, name, components, targets, examples=EXAMPLES):
        source, build = self.work / name, self.work / name / "build"
        source.mkdir()
        (source / "CMakeLists.txt").write_text(
            LISTS.format(components=components, targets=targets, examples=" ".join(examples),
                         source=ROOT / "tools/examples"))
        run(CMAKE, "-S", source, "-B", build, "-DCMAKE_BUILD_TYPE=Release", env=self.environment)
        run(CMAKE, "--build", build, "-j2", env=self.environment)
        return build

    def pkg_config(self, name, package, *options, environment=None):
        """Builds an example with the flags of pkg-config."""
        environment = environment or self.environment
        flags = run("pkg-config", "--cflags", "--libs", *options, package, env=environment).split()
        program = self.work / "-".join([name, package, *options])
        run("c++", "-std=c++20", ROOT / f"tools/examples/{name}.cpp", "-o", program, *flags, env=environment)
        return program

    def try_examples(self, programs):
        """Runs the examples one after another; the last one reads what the others wrote."""
        sphere, shaded = self.work / "sphere.ptcx", self.work / "shaded.ptcx"
        mesh = self.work / "mesh.obj"
        mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
        run(programs / "write_points", sphere, env=self.environment)
        self.assertIn("shaded", run(programs / "build_and_shade", mesh, shaded, env=self.environment))
        self.assertIn("100000 points", run(programs / "read_points", sphere, env=self.environment))
        self.assertIn("points", run(programs / "read_points", shaded, env=self.environment))
        damaged = self.work / "damaged.ptcx"
        data = bytearray(sphere.read_bytes())
        data[5000] ^= 1
        damaged.write_bytes(data)
        done = subprocess.run([programs / "read_points", damaged], capture_output=True, text=True, env=self.environment)
        self.assertEqual((done.returncode, "damaged.ptcx: offset" in done.stderr), (1, True), done.stderr)

    def test_examples_build_with_cmake_against_the_shared_libraries(self):
        build = self.cmake("shared", "store ptc", "ptc::ptc")
        self.assertIn("libptc", needed(build / "write_points"))
        self.try_examples(build)

    def test_examples_build_with_cmake_against_the_static_libraries(self):
        build = self.cmake("static", "static", "ptc::ptc-static")
        self.assertFalse(any(name.startswith("libptc") for name in needed(build / "write_points")))
        self.try_examples(build)

    def test_libptc_finds_the_library_next_to_it(self):
        self.assertIn("[$ORIGIN]", run("readelf", "-d", self.libraries / "libptc.so"))

    def test_examples_build_with_pkg_config(self):
        for name in EXAMPLES:
            self.pkg_config(name, "ptc")
        program = self.pkg_config("read_points", "ptc-store")
        self.assertIn("libptc-store", needed(program))
        self.assertNotIn("libptc", needed(program))

    def test_examples_build_with_pkg_config_against_static_libraries_alone(self):
        prefix = self.work / "archives"
        shutil.copytree(self.prefix, prefix, symlinks=True)
        for library in prefix.rglob("*.so*"):
            library.unlink()
        packages = next(prefix.rglob("ptc.pc")).parent
        environment = dict(self.environment, PKG_CONFIG_PATH=str(packages))
        programs = self.work / "archived"
        programs.mkdir()
        for name in EXAMPLES:
            program = self.pkg_config(name, "ptc", "--static", environment=environment)
            self.assertFalse(any(other.startswith("libptc") for other in needed(program)))
            program.rename(programs / name)
        self.try_examples(programs)
        reader = self.pkg_config("read_points", "ptc-store", "--static", environment=environment)
        self.assertFalse(any(other.startswith("libptc") for other in needed(reader)))

    def test_pkg_config_asks_for_no_package_that_only_the_libraries_need(self):
        for package, others in (("ptc-store", set()), ("ptc", {"glm"})):
            folder = self.work / f"{package}-alone"
            folder.mkdir()
            for own in (self.libraries / "pkgconfig").glob("*.pc"):
                shutil.copy(own, folder)
            for name in others:
                (folder / f"{name}.pc").write_text(f"Name: {name}\nDescription: {name}\nVersion: 1\n")
            environment = dict(self.environment, PKG_CONFIG_PATH="", PKG_CONFIG_LIBDIR=str(folder))
            flags = run("pkg-config", "--cflags", package, env=environment).split()
            self.assertEqual(len({flag for flag in flags if flag.startswith("-I")}), 1, flags)

    def test_the_library_passes_glm_on_to_what_includes_its_headers(self):
        for name, target in (("ptcTargets.cmake", "ptc::ptc"), ("ptcStaticTargets.cmake", "ptc::ptc-static")):
            text = next(self.prefix.rglob(name)).read_text()
            links = re.search(rf'set_target_properties\({target} .*?INTERFACE_LINK_LIBRARIES "([^"]*)"', text, re.DOTALL)
            self.assertIn("glm::glm", links[1].split(";"), target)
        self.assertIn("glm", run("pkg-config", "--print-requires", "ptc", env=self.environment).split())
        self.assertNotIn("glm", run("pkg-config", "--print-requires", "ptc-store", env=self.environment).split())

    def test_programs_in_the_documents_compile(self):
        flags = run("pkg-config", "--cflags", "ptc", env=self.environment).split()
        for document in ("README.md", "spec/guide/library.md"):
            blocks = re.findall(r"^```cpp\n(.*?)^```$", (ROOT / document).read_text(), re.MULTILINE | re.DOTALL)
            self.assertGreater(len(blocks), 0, document)
            for block in blocks:
                run("c++", "-std=c++20", "-fsyntax-only", *flags, "-x", "c++", "-", input=block)

    def test_a_reader_of_containers_needs_zstd_lz4_and_xxhash_and_nothing_else(self):
        system = {"libstdc++", "libm", "libgcc_s", "libc", "ld-linux-x86-64", "ld-linux-aarch64"}
        self.assertEqual(needed(self.libraries / "libptc-store.so") - system, {"libzstd", "liblz4", "libxxhash"})
        build = self.cmake("store", "store", "ptc::store", ["read_points"])
        self.assertEqual(needed(build / "read_points") - system, {"libptc-store"})

    def test_the_library_needs_no_library_of_the_programs(self):
        names = needed(self.libraries / "libptc.so")
        self.assertIn("libptc-store", names)
        for name in ("libcairo", "libcatch", "libCLI11"):
            self.assertFalse(any(other.lower().startswith(name.lower()) for other in names), names)

    def test_headers_are_under_ptc_alone_and_include_each_other_from_there(self):
        include = self.prefix / "include"
        self.assertEqual([path.name for path in include.iterdir()], ["ptc"])
        headers = sorted(path.relative_to(include) for path in include.rglob("*.h"))
        self.assertGreater(len(headers), 30)
        source = self.work / "headers.cpp"
        source.write_text("".join(f"#include <{header}>\n" for header in headers))
        run("c++", "-std=c++20", "-fsyntax-only", f"-I{include}", source)
        for header in headers:
            self.assertNotIn('#include "engine/', (include / header).read_text(), header)
            self.assertNotIn('#include "format/', (include / header).read_text(), header)

    def test_each_program_has_its_manual_page_and_completions_and_nothing_else_is_there(self):
        programs = {path.name for path in (self.prefix / "bin").iterdir()}
        share = self.prefix / "share"
        for folder, name in (("man/man1", "{}.1.gz"), ("bash-completion/completions", "{}"),
                             ("zsh/site-functions", "_{}"), ("fish/vendor_completions.d", "{}.fish")):
            self.assertEqual({path.name for path in (share / folder).iterdir()}, {name.format(one) for one in programs})

    def test_a_file_is_known_by_its_first_bytes(self):
        magic = next(self.prefix.rglob("ptcx.magic"))
        sample = next((ROOT / "spec/vectors/good").glob("*.ptcx"))
        self.assertIn("PTCX container", run("file", "-m", magic, sample))


if __name__ == "__main__":
    unittest.main()
