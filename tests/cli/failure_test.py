"""The machine refuses: exit 3, and nothing half written stays."""

import json
import os
import resource
import signal
import subprocess
import time
import unittest

from programs import BIN, SMALL_PICTURE, ProgramTest, ball, run, write_ply


class SystemFailure(ProgramTest):
    def test_outputs_that_cannot_be_opened(self):
        for program, operands, name in (("ptcbuild", [self.cloud, "-o"], "o.ptcx"),
                                        ("ptclight", [self.scene, "--sun", "30,60", "-o"], "o.ptcx"),
                                        ("ptcshade", [self.scene, "-o"], "o.ply"),
                                        ("ptcrender", [self.scene, *SMALL_PICTURE, "-o"], "o.png"),
                                        ("ptcconvert", [self.scene], "o.ply")):
            path = self.here / "none" / name
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path = self.here / name
            path.mkdir()
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path.rmdir()

    def test_a_limit_on_the_size_of_files_leaves_nothing(self):
        """The system sends SIGXFSZ, which ends a program unless it ignores the signal."""
        picture = ["--size", "200x200", "--camera", "0,0,3,0,0,0", "--samples", "1"]
        spilling = ["--city", "700k", "--page-size", "1M", "--profile", "raw", "-o", self.here / "o.ptcx"]
        for program, operands, kib in (("ptcbuild", [self.cloud, "-o", self.here / "o.ptcx"], 8),
                                       ("ptcbuild", [*spilling, "--memory=106M"], 1024), ("ptcbuild", [*spilling, "--memory=300M", "--resume"], 1024),
                                       ("ptcbuild", [self.cloud, "--resume", "-o", self.here / "o.ptcx"], 0),
                                       ("ptcbuild", [self.cloud, "--append", self.scene, "-o", self.here / "o.ptcx"], 8),
                                       ("ptclight", [self.scene, "--sun", "30,60", "-o", self.here / "o.ptcx"], 8),
                                       ("ptcshade", [self.scene, "-o", self.here / "o.ply"], 8),
                                       ("ptcshade", [self.scene, "-o", self.here / "o.ptcx"], 8),
                                       ("ptcshade", [self.scene, "-o", self.here / "o.ply", "--bounces", "2"], 8),
                                       ("ptcrender", [self.scene, "-o", self.here / "o.exr", *picture], 8),
                                       ("ptcrender", [self.scene, "-o", self.here / "o.png", *picture], 1),
                                       ("ptcconvert", [self.scene, self.here / "o.ply"], 8),
                                       ("ptcconvert", [self.scene, self.here / "o.xyz"], 8),
                                       ("ptcconvert", [self.scene, self.here / "o.ptcx"], 8),
                                       ("ptcconvert", [self.cloud, self.here / "o.ptcx"], 8),
                                       ("ptcverify", [self.scene, "--salvage", self.here / "o.ptcx"], 8),
                                       ("ptcverify", [self.scene, "--map", self.here / "o.svg"], 1)):
            limit = 1024 * kib
            message = self.fail_with(3, program, *operands, preexec_fn=lambda: resource.setrlimit(
                resource.RLIMIT_FSIZE, (limit, limit)))
            self.assertRegex(message, rf"{self.here}.*: it needs \d+ bytes or more, but a file of this process may have "
                                      rf"only {limit} \(ulimit -f\): File too large", operands)

    def test_a_build_that_met_a_limit_on_the_size_of_files_goes_on_without_it(self):
        temps = [self.here / name for name in ("t1", "t2")]
        command = ["ptcbuild", "--city", "600k", "--memory", "180M", "--profile", "raw", "-o", self.here / "o.ptcx"]
        self.succeed(*command)
        whole = (self.here / "o.ptcx").read_bytes()
        (self.here / "o.ptcx").unlink()
        for temp in temps:  # each has room for half of the points; the container does not fit
            temp.mkdir()
            command += ["--temp", temp]
        command += ["--resume", "--checkpoint", "50k"]
        limited = run(*command, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (14 << 20, 14 << 20)))
        self.assertEqual(limited.returncode, 3, limited.stderr)
        self.assertRegex(limited.stderr, r"o\.ptcx\.resume-pages: it needs \d+ bytes or more")
        self.assertFalse((self.here / "o.ptcx").exists())
        self.assertIn("continuing with", self.succeed(*command).stderr)
        self.assertEqual((self.here / "o.ptcx").read_bytes(), whole)
        self.assertEqual(sorted(path.name for path in self.here.rglob("*")), ["o.ptcx", "t1", "t2"])

    def test_a_build_that_was_killed_goes_on_to_the_same_bytes(self):
        command = ["ptcbuild", "--city", "600k", "--memory", "180M", "-o", self.here / "o.ptcx"]
        self.succeed(*command)
        whole = (self.here / "o.ptcx").read_bytes()
        (self.here / "o.ptcx").unlink()
        command += ["--resume", "--checkpoint", "50k"]
        died = gone_on = 0
        checkpoint = self.here / "o.ptcx.resume-at"
        for turn, number in enumerate((signal.SIGKILL, signal.SIGTERM, signal.SIGINT) * 4):
            process = subprocess.Popen([str(BIN / command[0]), *map(str, command[1:])], stdout=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, text=True)
            time.sleep(0.05 + 0.03 * died)  # any moment, every other time after a checkpoint
            while turn % 2 and process.poll() is None and not checkpoint.exists():
                time.sleep(0.001)
            process.send_signal(number)
            told = process.communicate(timeout=60)[1]
            died += process.returncode == -number
            gone_on += "continuing with" in told
        self.assertGreater(died, 4)
        self.assertGreater(gone_on, 0)
        self.succeed(*command)
        self.assertEqual((self.here / "o.ptcx").read_bytes(), whole)
        self.assertEqual(os.listdir(self.here), ["o.ptcx"])

    def test_a_build_that_was_killed_in_its_sort_says_that_it_starts_again(self):
        command = ["ptcbuild", "--city", "2M", "--memory", "208M", "-o", self.here / "o.ptcx", "--resume"]
        process = subprocess.Popen([str(BIN / command[0]), *map(str, command[1:])], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        while not (self.here / "o.ptcx.resume").exists():
            time.sleep(0.001)
        process.kill()
        process.wait(60)
        self.assertIn("had not finished its sort: it starts again", self.succeed(*command).stderr)

    def test_two_builds_do_not_go_on_with_the_same_files(self):
        command = [str(BIN / "ptcbuild"), "--city", "2M", "--resume", "-o", str(self.here / "o.ptcx")]
        first = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not (self.here / "o.ptcx.resume").exists():
            time.sleep(0.01)
        second = run(*command[:1], *command[1:])
        self.assertEqual(second.returncode, 3)
        self.assertIn("another program is using it", second.stderr)
        self.assertEqual(first.wait(60), 0)

    def test_points_on_the_disk_that_are_not_what_was_written_are_refused(self):
        command = ["ptcbuild", "--city", "2M", "--memory", "208M", "-o", self.here / "o.ptcx", "--resume", "--checkpoint", "1"]
        process = subprocess.Popen([str(BIN / command[0]), *map(str, command[1:])], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        while not (self.here / "o.ptcx.resume-at").exists():
            time.sleep(0.001)
        process.kill()
        self.assertEqual(process.wait(60), -signal.SIGKILL)
        spill, = self.here.glob("o.ptcx.resume-spill-*")
        with open(spill, "r+b") as file:
            file.seek(-10_000, os.SEEK_END)  # among the last points
            byte = file.read(1)[0]
            file.seek(-10_000, os.SEEK_END)
            file.write(bytes([byte ^ 1]))
        for _ in range(2):
            message = self.fail_with(1, *command)
            self.assertRegex(message, r"ptcbuild: .*/o\.ptcx\.resume-spill-\w+-0: offset \d+: the \d+ points there are not "
                                      r"what was written; to start again, remove .*/o\.ptcx\.resume, .*" + spill.name)
        for path in self.here.iterdir():
            self.assertIn(str(path), message)
            path.unlink()
        self.succeed(*command)
        self.assertEqual(os.listdir(self.here), ["o.ptcx"])

    def build_to_kill(self):
        """Kills a build that can go on, once it has written pages, and returns its command."""
        command = ["ptcbuild", "--city", "2M", "--memory", "208M", "-o", self.here / "o.ptcx", "--resume", "--checkpoint", "100k"]
        process = subprocess.Popen([str(BIN / command[0]), *map(str, command[1:])], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        while not (self.here / "o.ptcx.resume-at").exists():
            time.sleep(0.001)
        process.kill()
        self.assertEqual(process.wait(60), -signal.SIGKILL)
        return command

    def test_pages_on_the_disk_that_are_not_what_was_written_are_refused(self):
        command = self.build_to_kill()
        with open(self.here / "o.ptcx.resume-pages", "r+b") as file:
            file.seek(4096 + 1000)  # in the first page's payload
            byte = file.read(1)[0]
            file.seek(4096 + 1000)
            file.write(bytes([byte ^ 1]))
        message = self.fail_with(1, *command)
        self.assertRegex(message, r"o\.ptcx\.resume-pages: .*a page's checksum is wrong; to start again, remove ")
        self.assertFalse((self.here / "o.ptcx").exists())

    def test_a_spill_file_that_is_gone_is_named(self):
        command = self.build_to_kill()
        spill, = self.here.glob("o.ptcx.resume-spill-*")
        spill.unlink()
        message = self.fail_with(1, *command)
        self.assertRegex(message, r"o\.ptcx\.resume-spill-\S+ is missing .*; to start again, remove ")

    def test_a_build_through_a_link_writes_the_file_behind_it(self):
        for resume in ([], ["--resume"]):
            (self.here / "real").mkdir(exist_ok=True)
            link = self.here / "link.ptcx"
            link.symlink_to("real/o.ptcx")  # which does not exist yet
            self.succeed("ptcbuild", self.cloud, *resume, "-o", link)
            self.assertTrue(link.is_symlink())
            self.assertEqual(os.listdir(self.here / "real"), ["o.ptcx"])
            (self.here / "real" / "o.ptcx").unlink()
            link.unlink()

    def test_of_two_appends_at_once_none_loses_points(self):
        self.succeed("ptcbuild", self.cloud, "-o", self.here / "s.ptcx")
        points = lambda: json.loads(run("ptcinfo", "--json", self.here / "s.ptcx").stdout)["points"]
        before = points()
        command = [str(BIN / "ptcbuild"), str(self.cloud), "--append", str(self.here / "s.ptcx"), "-o", str(self.here / "s.ptcx")]
        both = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) for _ in range(8)]
        told = [process.communicate(timeout=60)[1] for process in both]
        done = sum(process.returncode == 0 for process in both)
        self.assertGreater(done, 0)
        self.assertEqual(points(), before * (1 + done))
        for process, text in zip(both, told):
            if process.returncode != 0:
                self.assertEqual(process.returncode, 1, text)
                self.assertIn("another program replaced this file in the meantime", text)
        self.assertEqual(sum(".tmp-" in name for name in os.listdir(self.here)), 0)

    def test_threads_that_cannot_be_started_are_an_error(self):
        limited = run("ptcbuild", "--city", "100k", "--threads", "200", "--memory", "20G", "-o", self.here / "o.ptcx",
                      preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (1_500_000_000, 1_500_000_000)))
        self.assertEqual(limited.returncode, 3, limited.stderr)
        self.assertRegex(limited.stderr, r"starting 199 threads, of which only \d+ fit the memory or the limit")

    def test_what_is_left_of_another_build_is_refused(self):
        command = ["ptcbuild", self.cloud, "-o", self.here / "o.ptcx", "--resume"]
        self.succeed(*command)
        (self.here / "o.ptcx.resume").write_bytes(b"PTXSTATE and what is torn")
        message = self.fail_with(1, *command)
        self.assertIn("o.ptcx.resume: the state is truncated; to start again, remove ", message)

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
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGXCPU, signal.SIGPIPE):
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


if __name__ == "__main__":
    unittest.main()
