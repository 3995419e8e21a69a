"""Makes the Debian packages, looks into them, and has lintian look at them where it is installed."""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from commands import BUILD, CMAKE, run

CPACK = CMAKE.with_name("cpack")
PACKAGES = {"libptc", "libptc-dev", "ptcx-tools"}


class Debian(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        work = pathlib.Path(cls.directory.name)
        run(CPACK, "-G", "DEB", "--config", BUILD / "CPackConfig.cmake", "-B", work,
            "-D", "CPACK_PACKAGING_INSTALL_PREFIX=/usr")
        cls.packages = {path.name.split("_")[0]: path for path in work.glob("*.deb")}

    @classmethod
    def tearDownClass(cls):
        cls.directory.cleanup()

    def files(self, package):
        lines = run("dpkg-deb", "--contents", self.packages[package]).splitlines()
        return {line.split(" ./")[1].split(" -> ")[0] for line in lines if " ./" in line}

    def test_there_are_three_packages_and_each_holds_its_part(self):
        self.assertEqual(set(self.packages), PACKAGES)
        libraries, headers, tools = (self.files(name) for name in ("libptc", "libptc-dev", "ptcx-tools"))
        for library in ("libptc", "libptc-store"):  # versions 0.1 and 0.2 can be installed side by side
            self.assertTrue(any(re.search(rf"/{library}\.so\.0\.\d+$", name) for name in libraries), libraries)
            self.assertFalse(any(name.endswith(f"{library}.so.0") for name in libraries))
        self.assertFalse(any("/include/" in name or "/bin/" in name for name in libraries))
        self.assertIn("usr/include/ptc/ptc.h", headers)
        for ending in ("libptc.a", "libptc-store.a", "ptcConfig.cmake", "pkgconfig/ptc.pc", "pkgconfig/ptc-store.pc"):
            self.assertTrue(any(name.endswith(ending) for name in headers), ending)
        for program in ("ptcbuild", "ptcfarm", "ptclight", "ptcshade", "ptcrender", "ptcconvert", "ptcinfo", "ptcverify"):
            self.assertIn(f"usr/bin/{program}", tools)
            self.assertIn(f"usr/share/zsh/vendor-completions/_{program}", tools)
        self.assertFalse(any("site-functions" in name for name in tools))
        self.assertIn("usr/share/mime/packages/ptcx.xml", tools)

    def test_a_package_names_what_it_needs(self):
        def depends(name):
            return run("dpkg-deb", "--field", self.packages[name], "Depends")

        self.assertIn("libembree", depends("libptc"))
        self.assertIn("libptc (=", depends("libptc-dev"))
        self.assertNotIn("cairo", depends("libptc"))
        self.assertEqual(run("dpkg-deb", "--field", self.packages["libptc"], "Recommends").strip(), "libcurl4")

    @unittest.skipUnless(shutil.which("lintian"), "lintian is not installed")
    def test_lintian_has_no_errors(self):
        done = subprocess.run(["lintian", "--allow-root", "--fail-on", "error", *self.packages.values()],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual([line for line in done.stdout.splitlines() if line.startswith("E:")], [])


if __name__ == "__main__":
    if not shutil.which("dpkg-shlibdeps"):
        print("skipped: dpkg-shlibdeps is not installed")
        sys.exit(77)
    unittest.main()
