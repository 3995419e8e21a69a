"""Whatever mesh readers leave out is one line on stderr of every program that reads a mesh."""

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

    def test_names_in_a_file_cannot_command_the_terminal(self):
        self.bare.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \x1b[2Jred\nf 1 2 3\n")
        told = self.succeed("ptcbuild", self.bare, "--points", "500", "-o", self.here / "out.ptcx").stderr
        self.assertIn("becomes plain grey: '\\x1b[2Jred'\n", told)


if __name__ == "__main__":
    unittest.main()
