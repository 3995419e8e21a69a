"""The machine refuses: exit 3, and nothing half written stays."""

import os
import resource
import signal
import subprocess
import time
import unittest

from programs import BIN, SMALL_PICTURE, ProgramTest, ball, write_ply


class SystemFailure(ProgramTest):
    def test_outputs_that_cannot_be_opened(self):
        for program, operands, name in (("ptcbuild", [self.cloud, "-o"], "o.ptcx"),
                                        ("ptcshade", [self.scene, "-o"], "o.ply"),
                                        ("ptcrender", [self.scene, *SMALL_PICTURE, "-o"], "o.png"),
                                        ("ptcconvert", [self.scene], "o.ply")):
            path = self.here / "none" / name
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path = self.here / name
            path.mkdir()
            self.assertIn(str(path), self.fail_with(3, program, *operands, path))
            path.rmdir()

    def test_a_full_disk_leaves_nothing(self):
        def limit():  # what is written beyond fails with EFBIG
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

        for program, operands in (("ptcbuild", [self.cloud, "-o", self.here / "o.ptcx"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ply"]),
                                  ("ptcshade", [self.scene, "-o", self.here / "o.ptcx"]),
                                  ("ptcrender", [self.scene, "-o", self.here / "o.exr", "--size", "200x200",
                                                 "--camera", "0,0,3,0,0,0", "--samples", "1"]),
                                  ("ptcconvert", [self.scene, self.here / "o.ply"]),
                                  ("ptcconvert", [self.scene, self.here / "o.xyz"]),
                                  ("ptcconvert", [self.scene, self.here / "o.ptcx"])):
            self.fail_with(3, program, *operands, preexec_fn=limit)

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
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
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
