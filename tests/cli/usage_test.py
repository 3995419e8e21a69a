"""The command line: help, version, usage errors."""

import os
import re
import shlex
import shutil
import time
import unittest
from pathlib import Path

from programs import PROGRAMS, SMALL_PICTURE, WRITTEN, ProgramTest, ball, read_ply, write_ply

ROOT = Path(__file__).resolve().parent.parent.parent


class Usage(ProgramTest):
    def test_help_shows_examples_and_every_common_option(self):
        for program in PROGRAMS:
            text = self.succeed(program, "--help").stdout
            self.assertRegex(text, rf"\nExamples:\n  # .+\n  {program} ")
            for option in ("--memory", "--threads", "--temp", "--progress", "--quiet", "--json",
                           "--version", "--help"):
                self.assertIn(option, text, program)

    def test_examples_in_the_help_parse(self):
        # Their files do not exist, which must be the only error. Examples without files would run for long.
        for program in PROGRAMS:
            for line in self.succeed(program, "--help").stdout.split("Examples:\n")[1].splitlines():
                long = any(word in line for word in ("--city", "--quick", " build ", " growth ", " scale ", " sort "))
                if not line.startswith("  " + program) or long:
                    continue
                words = shlex.split(line.split("|")[0].replace("/scratch", str(self.here)))
                message = self.fail_with(1, program, *words[1:], cwd=self.here)
                self.assertRegex(message, "No such file or directory|no file matches", line)

    def test_version_names_program_and_format(self):
        for program in PROGRAMS:
            self.assertRegex(self.succeed(program, "--version").stdout,
                             rf"^{program} \d+\.\d+\.\d+ \(PTCX format \d+\.\d+\)\n$")

    def test_unknown_options_and_missing_arguments_are_usage_errors(self):
        for program in PROGRAMS:
            self.assertIn("--help", self.fail_with(2, program))
            self.assertIn("--help", self.fail_with(2, program, "--no-such-option", "file"))

    def test_usage_errors_are_told_in_the_words_of_the_help(self):
        out = ["-o", self.here / "o.ptcx"]
        for arguments, text in ((["ptcinfo", self.scene, "--no-such"], "unknown option: --no-such"),
                                (["ptcinfo", self.scene, "--no-such=1"], "unknown option: --no-such"),
                                (["ptcbuild", self.mesh, "--pionts", "9", *out], "unknown option: --pionts; did you mean --points?"),
                                (["ptcbuild", self.mesh, "--ponits=9", *out], "unknown option: --ponits; did you mean --points?"),
                                (["ptcshade", self.scene, "--erorr", "2%", *out], "unknown option: --erorr; did you mean --error?"),
                                (["ptcinfo", self.scene, "-jsn"], "unknown option: -jsn; did you mean --json?"),
                                (["ptcinfo", self.scene, "--jqqq"], "unknown option: --jqqq"),
                                (["ptcinfo", self.scene, "x"], "takes one FILE, so 'x' is one argument too many"),
                                (["ptcinfo", self.scene, "--", "x"], "takes one FILE, so 'x' is one argument too many"),
                                (["ptcverify", "a", "x", "y"], "takes one FILE, so 'x' is one argument too many"),
                                (["ptcconvert", "a", "b.ply", "x"], "takes one INPUT and one OUTPUT, so 'x' is one argument too many"),
                                (["ptcbuild", self.mesh, "--city", "9", *out], "INPUT cannot be combined with --city"),
                                (["ptcbuild", self.mesh, *out, "--points"], "--points needs a value: COUNT"),
                                (["ptcbuild", self.mesh, *out, "--leaf", "1", "--leaf", "2"], "--leaf is given more than once"),
                                (["ptcbuild", self.mesh, *out, "--resume=x"], "--resume does not take the value 'x'"),
                                (["ptcbuild", self.mesh, *out, "--checkpoint", "9"], "--checkpoint requires --resume"),
                                (["ptcverify", self.scene, "--level", "5"], "--level: expects a number from 0 to 4, not '5'"),
                                (["ptcshade", self.scene], "--output is required")):
            self.assertEqual(self.fail_with(2, *arguments),
                             f"{arguments[0]}: {text}\nTry '{arguments[0]} --help'.\n")
        if "ptcbench" in PROGRAMS:
            self.assertIn("ptcbench: a command is required\n", self.fail_with(2, "ptcbench"))

    def test_wrong_values_of_common_options_are_usage_errors(self):
        for program in PROGRAMS:
            operands = {"ptcinfo": [self.scene], "ptcverify": [self.scene],
                        "ptcconvert": [self.scene, self.here / "o.ply"],
                        "ptcbake": [self.scene, "-o", self.here / "o.png"],
                        "ptcrender": [self.scene, "-o", self.here / "o.png"],
                        "ptcshade": [self.scene, "-o", self.here / "o.ply"],
                        "ptclight": [self.scene, "-o", self.here / "o.ptcx"],
                        "ptcfarm": ["plan", self.scene, "-o", self.here / "o.json"],
                        "ptcbuild": [self.cloud, "-o", self.here / "o.ptcx"],
                        "ptcbench": ["accuracy", self.mesh, "-o", self.here / "o"]}[program]
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
                         "--point=1,2,3", "--point=0,0,0,1,1,-1", "--point=0,0,0,5kg", "--point=0,0,0W", "--point=0,0,0,1,2W",
                         "--point=0,0,0,5lx", "--point=0,0,0,5 W", "--point=0,0,0,5W,5W,5W", "--point=0,0,0,-5W", "--point=0,0,0,W",
                         "--sun=1,2,5W", "--sun=1,2lx", "--sun=1,2,-3lx", "--spot=0,3,0,0,-1,0,40,1,1,1",
                         "--spot=0,3,0,0,-1,0,40,0.2", "--spot=0,3,0,0,0,0,40,0.2,1", "--spot=0,3,0,0,-1,0,0,0.2,1",
                         "--spot=0,3,0,0,-1,0,91,0.2,1", "--spot=0,3,0,0,-1,0,40,1.1,1", "--spot=0,3,0,0,-1,0,40,-0.1,1",
                         "--spot=0,3,0,0,-1,0,40,0.2,-1", "--spot=0,3,0,0,-1,0,40,0.2,1,1,1lx", "--spot=0,3,0,0,1e300,1e300,40,0.2,1",
                         "--sky=1,2", "--sky=-1",
                         "--sky-scale=-1", "--camera=1,2,3", "--camera=1,2,3,1,2,3", "--fov=40",
                         "--leaf=0", "--leaf=65536", "--levels-per-stream=0", "--codec=lzma",
                         "--page-size=3K", "--page-size=2M", "--sun-rays=0", "--finest=0",
                         "--city=5", "--output=", "--checkpoint=1M", "--resume=x"],
            "ptclight": ["--sun=1", "--point=1,2,3", "--spot=1", "--sky=-1", "--solid-angle=0", "--lift=-1", "--area-rays=0",
                         "--sun-rays=0", "--io=mail", "--output=o.ply"],
            "ptcshade": ["--solid-angle=0", "--parallax=-1", "--inflation=nan",
                         "--inflation=0", "--resolution=7", "--resolution=65", "--sides=back",
                         "--lift=-1", "--bounces=-1", "--bounces=1.5", "--bounces=1001", "--io=mail", "--check=-1", "--check-rays=0",
                         "--error=0", "--error=0%", "--error=-2%", "--error=2", "--error=101%", "--error=nan",
                         "--error=%", "--error=", "--error=2 %", "--error=two"],
            "ptcbake": ["--margin=-1", "--margin=65", "--size=0", "--size=10x", "--size=x5", "--size=65537", "--samples=2",
                        "--layer=reflection=o.png", "--layer=irradiance=o.exr"],
            "ptcrender": ["--bounces=-1", "--size=10", "--size=0x10", "--size=10x", "--size=-1x5", "--size=10x70000",
                          "--samples=0", "--samples=3", "--exposure=inf", "--layer=haze=a.png",
                          "--layer=direct=a.exr", "--layer=direct", "--camera=0,0,0,0,0,0"],
            "ptcconvert": ["--codec=", "--page-size=64"],
            "ptcfarm": ["--parts=-1", "--parts=10001", "--task-memory=much", "--number=-1", "--leaf=0", "--city=x",
                        "--output=o.txt", "--scene=o.ply", "--page-size=3K"],
        }
        operands = {"ptcbuild": [self.mesh, "-o", self.here / "o.ptcx"],
                    "ptclight": [self.scene, "-o", self.here / "o.ptcx"],
                    "ptcshade": [self.scene, "-o", self.here / "o.ply"],
                    "ptcbake": [self.scene, "-o", self.here / "o.png"],
                    "ptcrender": [self.scene, "-o", self.here / "o.png"],
                    "ptcconvert": [self.scene, self.here / "o.ptcx"],
                    "ptcfarm": ["plan", self.scene]}
        for program, options in cases.items():
            for option in options:
                self.assertIn(option.split("=")[0], self.fail_with(2, program, *operands[program], option))

    def test_an_error_stands_for_the_settings_that_trade_time_for_it(self):
        for program, output in (("ptcshade", "o.ply"), ("ptcrender", "o.png")):
            for option, value in (("--solid-angle", "0.1"), ("--parallax", "0.1"), ("--inflation", "1"),
                                  ("--resolution", "16")):
                message = self.fail_with(2, program, self.scene, "-o", self.here / output, "--error", "5%", option, value)
                self.assertIn(option, message)
                self.assertIn("--error", message)

    def test_estimates_need_rays_to_go_by_and_a_place(self):
        for program, output in (("ptcshade", "o.ply"), ("ptcrender", "o.exr")):
            for options in ([], ["--check", "0"]):
                message = self.fail_with(2, program, self.scene, "-o", self.here / output, "--estimate", *options)
                self.assertIn("--error or --check", message)
        message = self.fail_with(2, "ptcrender", self.scene, "-o", self.here / "o.png", "--estimate", "--check", "9")
        self.assertIn(".exr", message)

    def test_requests_that_the_library_refuses_are_told_in_options(self):
        shade = ["ptcshade", self.scene, "-o", self.here / "o.ply"]
        for options, text in ((["--tolerate-damage", "--bounces", "2"], "--tolerate-damage allows at most one bounce: "),
                              (["--tolerate-damage", "--check", "9"], "--tolerate-damage excludes --error and --check: "),
                              (["--estimate"], "--estimate needs rays to compare with: ask for --error or --check as well")):
            self.assertIn("ptcshade: " + text, self.fail_with(2, *shade, *options))
        to_container = ["ptcshade", self.scene, "-o", self.here / "o.ptcx"]
        self.assertIn("--count needs a .ply as output", self.fail_with(2, *to_container, "--count", "9"))
        self.assertIn("--tolerate-damage needs a .ply as output", self.fail_with(2, *to_container, "--tolerate-damage"))
        build = ["ptcbuild", self.mesh, "-o", self.here / "o.ptcx"]
        self.assertIn("--spacing is too small", self.fail_with(2, *build, "--spacing", "1e-30"))
        self.assertIn("a sun is negative or not finite", self.fail_with(2, *build, "--sun=1,2,1e30", "--sun-colour=1e30"))
        self.assertIn("a point light is not finite", self.fail_with(2, *build, "--point=1e300,0,0,1,1,1"))
        self.assertIn("a spot light is not finite", self.fail_with(2, *build, "--spot=1e300,0,0,0,-1,0,40,0,1"))
        scene = self.here / "s.ptcx"
        shutil.copy(self.scene, scene)
        message = self.fail_with(2, "ptcbuild", self.cloud, "--append", scene, "--resume", "-o", scene)
        self.assertIn("--resume with --append needs a target other than the scene", message)

    def test_options_that_messages_name_exist(self):
        helps = "".join(self.succeed(program, "--help").stdout for program in PROGRAMS)
        options = re.findall(r'FieldName\{"[^"]+", "(--[a-z-]+)"\}', (ROOT / "tools/field_names.cpp").read_text())
        self.assertGreater(len(options), 20)
        for option in options:
            self.assertRegex(helps, rf"{option}\b")

    def test_pictures_that_are_too_large_are_refused_before_work_begins(self):
        picture = ["ptcrender", self.scene, "-o", self.here / "o.png"]
        for size in ("65536x65536", "65536x4097"):
            self.assertIn("--size is " + size.replace("x", " x "), self.fail_with(2, *picture, "--size", size))
        begin = time.monotonic()
        self.assertIn("the least that works is", self.fail_with(5, *picture, "--size", "16384x16384", "--memory", "128M"))
        self.assertLess(time.monotonic() - begin, 10)

    def test_a_record_that_no_page_holds_is_refused_before_work_begins(self):
        lights = [f"--point=1.234567{i},2.345678{i},3.456789{i},1,2,3" for i in range(100)]
        build = ["ptcbuild", self.mesh, *lights, "-o", self.here / "o.ptcx"]
        message = self.fail_with(2, *build, "--page-size", "4K", "--points", "100G")
        self.assertRegex(message, r"record of lights, inputs and channels takes up to \d+ bytes.*--page-size")
        self.succeed(*build, "--points", "1k")
        message = self.fail_with(2, "ptcconvert", self.here / "o.ptcx", self.here / "small.ptcx", "--page-size", "4K")
        self.assertRegex(message, r"--page-size")

    def test_more_names_of_inputs_than_a_page_holds_are_cut(self):
        names = [self.here / f"a-cloud-of-many-with-a-long-name-{i}.ply" for i in range(60)]
        for name in names:
            write_ply(name, ball(9))
        self.succeed("ptcbuild", *names, "-o", self.here / "o.ptcx", "--page-size", "4K")
        text = self.succeed("ptcinfo", self.here / "o.ptcx", "--json").stdout
        self.assertRegex(text, r'"inputs": "a-cloud-of-many-with-a-long-name-0\.ply .*\.ply \.\.\."')

    def test_names_that_are_no_utf_8_are_taken(self):
        name = os.fsencode(self.here) + b"/ball\xff.ply"
        shutil.copy(self.cloud, name)
        self.succeed("ptcbuild", os.fsdecode(name), "-o", self.here / "o.ptcx")
        self.assertIn(r"ball\\xff.ply", self.succeed("ptcinfo", self.here / "o.ptcx", "--json").stdout)
        sky = os.fsdecode(os.fsencode(self.here) + b"/sky\xff.png")
        self.succeed("ptcrender", self.scene, *SMALL_PICTURE, "-o", sky)
        message = self.fail_with(2, "ptcbuild", self.mesh, "-o", self.here / "p.ptcx", "--sky", sky, errors="replace")
        self.assertIn("not UTF-8", message)

    def test_endings_in_capitals_mean_what_small_ones_do(self):
        self.succeed("ptcshade", self.scene, "-o", self.here / "o.PLY")
        self.assertEqual(read_ply(self.here / "o.PLY")[0][:len(WRITTEN)], WRITTEN)
        self.succeed("ptcshade", self.scene, "--receivers", self.scene, "--count", "9", "-o", self.here / "o.Ply")
        self.succeed("ptcrender", self.scene, *SMALL_PICTURE, "-o", self.here / "o.EXR", "-o", self.here / "o.PNG",
                     "--layer", f"occlusion={self.here}/a.Png")
        self.assertEqual((self.here / "o.EXR").read_bytes()[:4], b"\x76\x2f\x31\x01")
        for name in ("o.PNG", "a.Png"):
            self.assertEqual((self.here / name).read_bytes()[:4], b"\x89PNG")
        self.succeed("ptcconvert", self.scene, self.here / "o.PTCX")
        self.succeed("ptcconvert", self.here / "o.PTCX", self.here / "p.PLY")
        self.succeed("ptcverify", self.scene, "--map", self.here / "map.SVG")

    def test_each_picture_has_a_file_of_its_own(self):
        picture = self.here / "a.png"
        self.succeed("ptcrender", self.scene, *SMALL_PICTURE, "-o", self.here / "sky.png")
        (self.here / "link.png").symlink_to("a.png")
        for names in (["-o", picture, "-o", picture], ["-o", picture, "--layer", f"occlusion={picture}"],
                      ["-o", picture, "--layer", f"albedo={self.here / 'link.png'}"]):
            self.assertIn("is the name of two pictures", self.fail_with(2, "ptcrender", self.scene, *SMALL_PICTURE, *names))
        sky = self.here / "sky.png"
        before = sky.read_bytes()
        self.assertIn("is read by this run", self.fail_with(2, "ptcrender", self.scene, *SMALL_PICTURE, "--sky", sky, "-o", sky))
        self.assertEqual(sky.read_bytes(), before)

    def test_names_of_outputs_must_tell_their_kind(self):
        for program, operands in (("ptcbuild", [self.mesh, "-o"]), ("ptcshade", [self.scene, "-o"]),
                                  ("ptcrender", [self.scene, "-o"]), ("ptcconvert", [self.scene])):
            for name in ("out", "out.txt", ".png", "out.ptcx.bak"):
                self.assertIn("must end in", self.fail_with(2, program, *operands, self.here / name))

    def test_settings_of_a_light_need_that_light(self):
        for program, operands in (("ptcbuild", [self.mesh, "-o", self.here / "o.ptcx"]),
                                  ("ptcrender", [self.scene, "-o", self.here / "o.png"])):
            for option, value, light in (("--sun-colour", "1,0,0", "--sun"), ("--sun-size", "2", "--sun"),
                                         ("--sky-scale", "2", "--sky")):
                message = self.fail_with(2, program, *operands, option, value, "--point", "0,9,0,1,1,1")
                self.assertIn(f"{option} requires {light}\n", message)
        message = self.fail_with(2, "ptcshade", self.scene, "-o", self.here / "o.ply", "--sky-scale", "2")
        self.assertIn("--sky-scale requires --sky\n", message)

    def test_inputs_and_city_exclude_each_other_and_one_is_needed(self):
        self.fail_with(2, "ptcbuild", self.mesh, "--city", "1k", "-o", self.here / "o.ptcx")
        self.fail_with(2, "ptcbuild", "-o", self.here / "o.ptcx")

    def test_a_cap_that_is_too_small_names_the_least_that_works(self):
        for program, operands in (("ptcbuild", [self.mesh, "--points", "1k", "-o", self.here / "o.ptcx"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ply"]),
                                  ("ptcrender", [self.scene, "-o", self.here / "o.png"]),
                                  ("ptcverify", [self.scene]), ("ptcinfo", [self.scene]),
                                  ("ptcconvert", [self.scene, self.here / "o.ply"]), ("ptcconvert", [self.scene, self.here / "p.ptcx"])):
            message = self.fail_with(5, program, *operands, "--memory", "1M")
            least = message.split("the least that works is ")[1].split()[0]
            self.succeed(program, *operands, "--memory", least,
                         *(SMALL_PICTURE if program == "ptcrender" else []))


if __name__ == "__main__":
    unittest.main()
