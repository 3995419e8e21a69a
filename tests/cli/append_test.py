"""ptcbuild --append: appending points to a container."""

import json
import math
import os
import unittest

from programs import ProgramTest, ball, read_ply, write_ply


def moved(points, step):
    return [(*(a + b for a, b in zip(p, step)), *p[3:]) for p in points]


class Append(ProgramTest):
    def setUp(self):
        super().setUp()
        self.other = self.here / "other.ply"
        write_ply(self.other, moved(ball(500, seed=2), (1.5, 0.25, 0)))

    def append(self, target, *options):
        self.succeed("ptcbuild", self.other, "--append", self.scene, "-o", target, *options)

    def columns(self, scene):
        """Returns positions and occlusion of all points by radius and normal, which identify them."""
        lit = self.here / "lit.ply"
        self.succeed("ptcshade", scene, "-o", lit)
        names, points = read_ply(lit)
        at = [names.index(name) for name in ("radius", "nx", "ny", "nz", "x", "y", "z", "occlusion")]
        lit.unlink()
        return sorted([p[i] for i in at] for p in points)

    def test_points_and_shading_are_those_of_both_built_at_once(self):
        together, both = self.here / "ab.ptcx", self.here / "both.ptcx"
        self.append(together)
        self.succeed("ptcbuild", self.cloud, self.other, "-o", both)
        a, b = self.columns(together), self.columns(both)
        self.assertEqual(len(a), 1100)
        self.assertEqual([p[:4] for p in a], [p[:4] for p in b])
        for p, q in zip(a, b):
            self.assertLess(math.dist(p[4:7], q[4:7]), 0.002 * p[0] + 1e-6)
        off = math.sqrt(sum((p[7] - q[7]) ** 2 for p, q in zip(a, b)) / len(a))
        self.assertLess(off, 0.01)
        self.succeed("ptcverify", together, "--level", "4")

    def test_the_old_name_may_be_the_new_one(self):
        target = self.here / "s.ptcx"
        target.write_bytes(self.scene.read_bytes())
        for points in (1100, 1600):
            self.succeed("ptcbuild", self.other, "--append", target, "-o", target)
            self.assertEqual(json.loads(self.succeed("ptcinfo", target, "--json").stdout)["points"], points)

    def test_bytes_depend_on_neither_threads_nor_memory(self):
        made = set()
        for options in (["--threads", "1"], ["--threads", "3", "--memory", "128M"], ["--resume", "--checkpoint", "100"]):
            target = self.here / "t.ptcx"
            self.append(target, *options)
            made.add(target.read_bytes())
        self.assertEqual(len(made), 1)

    def test_a_damaged_scene_is_refused_and_stays(self):
        target = self.here / "s.ptcx"
        whole = self.scene.read_bytes()
        for at in (len(whole) - 4096, 5000, 100):
            target.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1:])
            before = target.read_bytes()
            if at == len(whole) - 4096:  # one of the two superblocks: the other is enough
                self.succeed("ptcbuild", self.other, "--append", target, "-o", self.here / "t.ptcx")
                (self.here / "t.ptcx").unlink()
            else:
                self.assertIn("s.ptcx: offset ", self.fail_with(1, "ptcbuild", self.other, "--append", target, "-o", target))
            self.assertEqual(target.read_bytes(), before)

    def test_what_does_not_go_with_it_is_a_usage_error(self):
        output = ["-o", self.here / "o.ptcx"]
        self.fail_with(2, "ptcbuild", "--append", self.scene, *output)
        self.fail_with(2, "ptcbuild", "--append", self.scene, "--city", "10k", *output)
        self.assertIn("lights", self.fail_with(2, "ptcbuild", self.mesh, "--append", self.scene, "--sun", "1,2,3", *output))
        self.assertIn("ball.ply", self.fail_with(1, "ptcbuild", self.mesh, "--append", self.cloud, *output))
        self.fail_with(1, "ptcbuild", self.mesh, "--append", self.here / "none.ptcx", *output)
        self.succeed("ptcbuild", self.mesh, "--points", "1k", "--append", self.scene, *output)  # lit as the scene
        self.assertEqual(sorted(os.listdir(self.here)), ["o.ptcx", "other.ply"])


if __name__ == "__main__":
    unittest.main()
