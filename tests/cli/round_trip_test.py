"""Whatever is written to a container is read back from it."""

import json
import unittest

from programs import WRITTEN, ProgramTest, read_ply


class RoundTrip(ProgramTest):
    def columns(self, path):
        names, points = read_ply(path)
        order = sorted(points)
        return {name: [p[i] for p in order] for i, name in enumerate(names)}

    def test_ply_to_container_to_ply_keeps_every_point(self):
        exact, back = self.here / "exact.ptcx", self.here / "back.ply"
        self.succeed("ptcbuild", self.cloud, "--profile", "exact", "-o", exact)
        self.succeed("ptcconvert", exact, back)
        was, now = self.columns(self.cloud), self.columns(back)
        self.assertEqual(list(now), WRITTEN)
        colours = {"albedo_r": "red", "albedo_g": "green", "albedo_b": "blue"}  # as the cloud names them
        for name in WRITTEN[:13]:
            for a, b in zip(was[colours.get(name, name)], now[name], strict=True):
                if name in ("x", "y", "z"):
                    self.assertLessEqual(abs(a - b), 2 ** -40)  # half a unit of a lattice of 4
                elif name == "radius":
                    self.assertEqual(a, b)
                elif name.startswith("n"):
                    self.assertLessEqual(abs(a - b), 1.1e-4)
                elif name.startswith("radiance"):
                    self.assertLessEqual(abs(a - b), 2 ** -11 * a)
                else:
                    self.assertLessEqual(abs(a - b), 0.5 / 255 + 1e-7)

    def test_a_second_round_changes_nothing(self):
        first, second = self.here / "1.ply", self.here / "2.ply"
        self.succeed("ptcconvert", self.scene, first)
        self.succeed("ptcconvert", first, self.here / "2.ptcx")
        self.succeed("ptcconvert", self.here / "2.ptcx", second)
        for name, values in self.columns(first).items():
            for a, b in zip(values, self.columns(second)[name], strict=True):
                self.assertLessEqual(abs(a - b), 6.2e-5 if name.startswith("n") else 0, name)

    def test_container_to_xyz_to_container(self):
        self.succeed("ptcconvert", self.scene, self.here / "a.xyz")
        self.succeed("ptcconvert", self.here / "a.xyz", self.here / "b.ptcx")
        self.succeed("ptcconvert", self.scene, self.here / "a.ply")
        self.succeed("ptcconvert", self.here / "b.ptcx", self.here / "b.ply")
        a, b = self.columns(self.here / "a.ply"), self.columns(self.here / "b.ply")
        for name in ("x", "y", "z", "radius", "radiance_r", "radiance_g", "radiance_b"):
            self.assertEqual(a[name], b[name], name)

    def test_other_codecs_and_page_sizes_hold_the_same(self):
        lit = self.here / "lit.ptcx"
        self.succeed("ptcshade", self.scene, "-o", lit)
        reference = self.here / "lit.ply"
        self.succeed("ptcconvert", lit, reference)
        names, _ = read_ply(reference)
        for name in ("occlusion", "bent_normal_x", "irradiance_r", "sky_b", "indirect_g"):
            self.assertIn(name, names)
        for page_size in ("4K", "8K", "64K", "1M"):
            for profile, codec in (("raw", "raw"), ("exact", "zstd"), ("fast", "lz4"), ("compact", "zstd")):
                other, back = self.here / "other.ptcx", self.here / "other.ply"
                self.succeed("ptcconvert", lit, other, "--profile", profile, "--page-size", page_size)
                self.succeed("ptcverify", other)
                facts = json.loads(self.succeed("ptcinfo", other, "--json").stdout)
                self.assertEqual(facts["codec"], codec)
                self.assertEqual(facts["page_size"], int(page_size[:-1]) * (1 << (20 if "M" in page_size else 10)))
                self.succeed("ptcconvert", other, back)
                self.assertEqual(back.read_bytes(), reference.read_bytes())

    def test_shading_and_converting_name_channels_of_a_ply_alike(self):
        self.succeed("ptcshade", self.scene, "-o", self.here / "lit.ptcx", "--check", "9", "--estimate")
        self.succeed("ptcconvert", self.here / "lit.ptcx", self.here / "converted.ply")
        self.succeed("ptcshade", self.scene, "-o", self.here / "shaded.ply", "--check", "9", "--estimate")
        converted, shaded = read_ply(self.here / "converted.ply")[0], read_ply(self.here / "shaded.ply")[0]
        self.assertEqual(shaded, converted)
        self.assertEqual(shaded[len(WRITTEN):], [
            "occlusion", "bent_normal_x", "bent_normal_y", "bent_normal_z", "irradiance_r", "irradiance_g", "irradiance_b",
            "sky_r", "sky_g", "sky_b", "indirect_r", "indirect_g", "indirect_b", "occlusion_error", "irradiance_error"])

    def test_profiles_round_as_they_say(self):
        exact = self.here / "exact.ptcx"
        self.succeed("ptcconvert", self.cloud, exact)  # keeps the exact values
        self.succeed("ptcconvert", exact, self.here / "exact.ply")
        names, was = read_ply(self.here / "exact.ply")
        at = {name: i for i, name in enumerate(names)}
        for profile in ("fast", "compact"):
            for source in (exact, self.cloud):
                rounded, back = self.here / "rounded.ptcx", self.here / "rounded.ply"
                self.succeed("ptcconvert", source, rounded, "--profile", profile)
                self.succeed("ptcverify", rounded)
                self.assertIn("position by at most 0.001 of the point's radius", self.succeed("ptcinfo", rounded).stdout)
                self.succeed("ptcconvert", rounded, back)
                _, now = read_ply(back)
                moved = 0
                for a, b in zip(was, now, strict=True):
                    radius = b[at["radius"]]
                    distance = sum((a[at[k]] - b[at[k]]) ** 2 for k in "xyz") ** 0.5
                    self.assertLessEqual(distance, 0.001 * radius + 1e-12)
                    self.assertLessEqual(abs(a[at["radius"]] - radius), radius / 500)
                    moved += distance > 0
                self.assertGreater(moved, 0)
        self.assertNotIn("\n  rounded ", self.succeed("ptcinfo", exact).stdout)

    def channels_of(self, path):
        return json.loads(self.succeed("ptcinfo", path, "--json").stdout)["channels"]

    def test_a_shading_that_is_read_again_is_known_and_replaced(self):
        for ending in ("las", "ply", "pcd", "xyz"):
            lit, again, built = (self.here / f"{name}.{ending}" for name in ("lit", "again", "built"))
            self.succeed("ptcshade", self.cloud, "--check", "9", "-o", lit)
            # The channels are what they were, and a shading of the cloud or its container replaces them
            self.succeed("ptcbuild", lit, "--profile", "exact", "-o", self.here / "lit.ptcx")
            known = {c["name"]: c for c in self.channels_of(self.here / "lit.ptcx")}
            self.assertEqual((known["sky"]["components"], known["sky"]["role"]), (3, "colour"))
            self.assertEqual((known["bent_normal"]["components"], known["bent_normal"]["role"]), (3, "direction"))
            self.assertNotIn("sky_r", known)
            self.succeed("ptcverify", self.here / "lit.ptcx")
            self.succeed("ptcshade", lit, "--check", "9", "--estimate", "-o", again)
            self.succeed("ptcconvert", again, again.with_suffix(".ply"), "--channels", "occlusion,occlusion_error")
            self.succeed("ptcshade", self.here / "lit.ptcx", "--check", "9", "-o", self.here / "again.ptcx")
            self.succeed("ptcverify", self.here / "again.ptcx")
            names = [c["name"] for c in self.channels_of(self.here / "again.ptcx")]
            self.assertEqual(sorted(names), sorted(known))
            self.succeed("ptcconvert", self.here / "again.ptcx", built)
            self.assertFalse([n for n in names if n.startswith(("occlusion_", "sky_"))])

    def test_one_column_with_a_name_of_shading_is_kept_beside_it(self):
        own = self.here / "own.xyz"
        own.write_text("# x y z occlusion sky_r sky_g sky_b\n" +
                       "".join(f"{i % 9} {i // 9} 0 0.5 1 2 3\n" for i in range(81)))
        self.succeed("ptcshade", own, "--check", "9", "-o", self.here / "own.ply")
        names, points = read_ply(self.here / "own.ply")
        self.assertEqual({p[names.index("occlusion_2")] for p in points}, {0.5})
        self.assertIn("occlusion", names)

    def test_recoding_twice_gives_the_same_bytes(self):
        for name in ("a.ptcx", "b.ptcx"):
            self.succeed("ptcconvert", self.scene, self.here / name, "--profile", "raw")
        self.assertEqual((self.here / "a.ptcx").read_bytes(), (self.here / "b.ptcx").read_bytes())

    def test_a_container_may_be_recoded_over_itself(self):
        copy = self.here / "copy.ptcx"
        copy.write_bytes(self.scene.read_bytes())
        self.succeed("ptcconvert", copy, copy, "--profile", "raw", "--page-size", "8K")
        self.succeed("ptcverify", copy)

    def test_a_container_under_another_name_is_still_one(self):
        path = self.here / "scene.bin"
        path.write_bytes(self.scene.read_bytes())
        self.succeed("ptcconvert", path, self.here / "a.ply")
        self.succeed("ptcverify", path)

    def test_a_mesh_becomes_a_lit_container(self):
        self.succeed("ptcconvert", self.mesh, self.here / "a.ptcx", "--points", "1k")
        facts = json.loads(self.succeed("ptcinfo", self.here / "a.ptcx", "--json").stdout)
        self.assertGreater(min(facts["flux"]), 0)

    def test_a_mesh_becomes_no_cloud(self):
        self.fail_with(2, "ptcconvert", self.mesh, self.here / "a.xyz")


if __name__ == "__main__":
    unittest.main()
