"""Whatever mesh readers leave out, and every option without effect, is one line on stderr."""

import unittest

from programs import SMALL_PICTURE, ProgramTest


class Warnings(ProgramTest):
    def setUp(self):
        super().setUp()
        self.bare = self.here / "bare.obj"
        (self.here / "bare.mtl").write_text("newmtl wood\nmap_Kd none.png\n")
        self.bare.write_text("mtllib bare.mtl\nusemtl wood\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")

    def commands(self):
        scene = self.here / "out.ptcx"
        yield ["ptcbuild", self.bare, "--points", "500", "-o", scene]
        yield ["ptcbuild", self.bare, "--points", "500", "--append", self.box, "-o", scene]
        yield ["ptcrender", self.box, "--mesh", self.bare, *SMALL_PICTURE, "-o", self.here / "out.png"]

    def test_a_missing_texture_is_one_line(self):
        for command in self.commands():
            said = (f"{command[0]}: {self.bare}: a texture is left out and the plain colour of its material is used: "
                    "none.png: No such file or directory\n")
            self.assertEqual(self.succeed(*command).stderr, said)
            self.assertEqual(self.succeed(*command, "--json").stderr, said)
            self.assertEqual(self.succeed(*command, "--progress").stderr.count(said), 1)
            self.assertEqual(self.succeed(*command, "--quiet").stderr, "")

    def test_a_mesh_of_which_nothing_is_left_out_says_nothing(self):
        for command in self.commands():
            whole = [self.mesh if word == self.bare else word for word in command]
            self.assertEqual(self.succeed(*whole).stderr, "")

    def test_an_option_that_the_input_leaves_without_effect_is_one_line(self):
        out = self.here / "out.ptcx"
        for command, said in (
                (["ptcbuild", self.cloud, "--up", "y", "--backdrop", "--points", "1M", "-o", out], "--points, --backdrop have no effect, because no input is a mesh"),
                (["ptcbuild", self.cloud, "--up", "y", "--spacing", "0.1", "-o", out], "--spacing has no effect, because no input is a mesh"),
                (["ptcbuild", "--city", "1k", "--points", "9k", "-o", out], "--points has no effect, because no input is a mesh"),
                (["ptcconvert", self.cloud, out, "--points", "9"], "--points has no effect, because the input is no mesh"),
                (["ptcconvert", self.scene, out, "--points", "9"], "--points has no effect, because the input is no mesh"),
                (["ptcconvert", self.scene, self.here / "out.ply", "--profile", "raw"], "--profile has no effect, because the output is no container"),
                (["ptcshade", self.scene, "--count", "601", "-o", self.here / "out.ply"], "--count is more than there are points: all 600 are shaded")):
            self.assertEqual(self.succeed(*command).stderr, f"{command[0]}: {said}\n")
            self.assertEqual(self.succeed(*command, "--quiet").stderr, "")
        for command in (["ptcbuild", self.cloud, "--up", "y", self.mesh, "--backdrop", "--points", "1k", "-o", out],
                        ["ptcbuild", self.cloud, "--up", "y", "--sun", "30,60", "--camera", "0,0,3,0,0,0", "-o", out],
                        ["ptcconvert", self.mesh, out, "--points", "1k", "--profile", "raw"],
                        ["ptcshade", self.scene, "--count", "600", "-o", self.here / "out.ply"]):
            self.assertEqual(self.succeed(*command).stderr, "")

    def test_an_axis_that_no_cloud_states_is_noted_once(self):
        out, text = self.here / "out.ptcx", self.here / "a.xyz"
        text.write_text("".join(f"{i % 9} {i // 9} 0 0 0 1 1\n" for i in range(81)))
        said = ": the file does not say which axis is up, y is taken; --up z if it is z\n"
        for command in (["ptcbuild", text, self.cloud, "-o", out],
                        ["ptcshade", text, self.cloud, "--check", "9", "-o", self.here / "out.ply"],
                        ["ptcrender", text, self.cloud, "--size", "24x16", "--samples", "1", "-o", self.here / "out.png"]):
            told = self.succeed(*command).stderr
            self.assertEqual(told.count(said), 1)
            self.assertIn(f"{command[0]}: a.xyz{said}", told)
            self.assertNotIn(said, self.succeed(*command, "--up", "y").stderr)
        stated = self.here / "a.pts"
        stated.write_text("2\n0 0 0\n1 1 1\n")
        self.assertNotIn(said, self.succeed("ptcbuild", text, stated, "-o", out).stderr)
        self.assertNotIn(said, self.succeed("ptcbuild", self.mesh, "--points", "500", "-o", out).stderr)

    def test_names_in_a_file_cannot_command_the_terminal(self):
        self.bare.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \x1b[2Jred\nf 1 2 3\n")
        told = self.succeed("ptcbuild", self.bare, "--points", "500", "-o", self.here / "out.ptcx").stderr
        self.assertIn("becomes plain grey: '\\x1b[2Jred'\n", told)


if __name__ == "__main__":
    unittest.main()
