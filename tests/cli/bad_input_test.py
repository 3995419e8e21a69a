"""Every kind of bad file, everywhere a program reads one."""

import math
import os
import random
import unittest
from pathlib import Path

from programs import BOX, CORE, SMALL_PICTURE, ProgramTest, ball, write_ply


class BadInput(ProgramTest):
    """Every kind of bad file, everywhere a program reads one: exit 1, the path, nothing left."""

    def consumers(self, kind):
        """Returns the commands that read a file of a kind, with {} in the place of its name."""
        out = {"ptcx": self.here / "out.ptcx", "ply": self.here / "out.ply",
               "png": self.here / "out.png", "exr": self.here / "out.exr"}
        commands = {
            "cloud": [["ptcbuild", "{}", "-o", out["ptcx"]],
                      ["ptcbuild", self.mesh, "{}", "-o", out["ptcx"]],
                      ["ptcconvert", "{}", out["ptcx"]],
                      ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ply"]],
                      ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ptcx"]]],
            "mesh": [["ptcbuild", "{}", "-o", out["ptcx"]],
                     ["ptcconvert", "{}", out["ptcx"]],
                     ["ptcrender", self.box, "--mesh", "{}", "-o", out["png"]]],
            "container": [["ptcinfo", "{}"], ["ptcverify", "{}"],
                          ["ptcshade", "{}", "-o", out["ptcx"]],
                          ["ptcshade", "{}", "-o", out["ply"]],
                          ["ptcshade", self.scene, "--receivers", "{}", "-o", out["ply"]],
                          ["ptcrender", "{}", "-o", out["png"]],
                          ["ptcrender", "{}", "-o", out["exr"]],
                          ["ptcconvert", "{}", out["ply"]],
                          ["ptcconvert", "{}", self.here / "out.xyz"],
                          ["ptcconvert", "{}", out["ptcx"]]],
            "sky": [["ptcbuild", self.mesh, "-o", out["ptcx"], "--sky", "{}"],
                    ["ptcshade", self.scene, "-o", out["ply"], "--sky", "{}"],
                    ["ptcrender", self.scene, "-o", out["png"], "--sky", "{}"]],
        }
        return commands[kind]

    def refuse(self, kind, path, *places, verdict=1):
        """Expects every program that reads a kind of file to refuse this one, naming it and one of `places`; ptcverify
        ends with its verdict."""
        for command in self.consumers(kind):
            arguments = [path if word == "{}" else word for word in command]
            message = self.fail_with(verdict if arguments[0] == "ptcverify" else 1, *arguments)
            self.assertIn(str(path), message)
            if places:
                self.assertTrue(any(place in message for place in places), message)

    def test_missing_files_and_directories(self):
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"),
                             ("container", ".ptcx"), ("sky", ".exr")):
            self.refuse(kind, self.here / ("none" + ending), "No such file or directory")
            self.refuse(kind, self.here / "none" / ("none" + ending))
            directory = self.here / ("directory" + ending)
            directory.mkdir()
            self.refuse(kind, directory, "Is a directory", "the directory holds no mesh and no cloud")
            os.mkfifo(self.here / ("pipe" + ending))
            self.refuse(kind, self.here / ("pipe" + ending), "Is not a regular file")
            os.remove(self.here / ("pipe" + ending))
            directory.rmdir()

    def test_standard_input_is_refused_as_such(self):
        for arguments in (["ptcinfo", "-"], ["ptcverify", "-"],
                          ["ptcshade", self.scene, "--receivers", "-", "-o", self.here / "o.ply"],
                          ["ptcrender", self.scene, "--mesh", "-", "-o", self.here / "o.png"]):
            self.assertIn("standard input is not taken here; write it to a file first", self.fail_with(1, *arguments))

    def test_empty_files(self):
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"),
                             ("mesh", ".gltf"), ("container", ".ptcx"), ("sky", ".exr"),
                             ("sky", ".png")):
            path = self.here / ("empty" + ending)
            path.touch()
            self.refuse(kind, path, "offset 0")

    def test_files_with_a_wrong_magic(self):
        noise = random.Random(7).randbytes(20000)
        for kind, ending in (("cloud", ".ply"), ("cloud", ".xyz"), ("mesh", ".obj"), ("mesh", ".glb"),
                             ("mesh", ".off"), ("container", ".ptcx"), ("sky", ".exr"),
                             ("sky", ".png")):
            path = self.here / ("noise" + ending)
            path.write_bytes(noise)
            self.refuse(kind, path)
        text = bytearray(self.scene.read_bytes())
        text[4] = 10  # a text-mode copy
        path = self.here / "text.ptcx"
        path.write_bytes(text)
        self.refuse("container", path, "offset 0")

    def test_truncated_clouds_and_meshes(self):
        for source, kind in ((self.cloud, "cloud"), (self.mesh, "mesh")):
            whole = source.read_bytes()
            path = self.here / ("short" + source.suffix)
            for share in (0.02, 0.2, 0.5):
                path.write_bytes(whole[:int(len(whole) * share)])
                self.refuse(kind, path)
        path = self.here / "short.ply"
        path.write_bytes(self.cloud.read_bytes()[:-1])
        self.refuse("cloud", path, "offset ")

    def test_truncated_containers(self):
        whole = self.scene.read_bytes()
        path = self.here / "short.ptcx"
        for size in (1, 7, 8, 100, 4095, 4096, 5000, len(whole) // 2, len(whole) - 8192,
                     len(whole) - 4096, len(whole) - 1):
            path.write_bytes(whole[:size])
            self.refuse("container", path, "offset ", verdict=6)

    def test_containers_that_grew(self):
        path = self.here / "long.ptcx"
        for tail in (b"\0", b"\0" * 4096, b"x" * 9000):
            path.write_bytes(self.scene.read_bytes() + tail)
            self.refuse("container", path, "offset ")

    def test_containers_with_a_damaged_page(self):
        whole = self.scene.read_bytes()
        path = self.here / "damaged.ptcx"
        damaged = bytearray(whole)
        damaged[4096 + 200] ^= 1  # the payload of the first page, points
        path.write_bytes(damaged)
        for command in self.consumers("container"):
            if command[0] == "ptcinfo":
                continue  # reads no points
            arguments = [path if word == "{}" else word for word in command]
            message = self.fail_with(1, *arguments, *(SMALL_PICTURE if command[0] == "ptcrender" else []))
            self.assertIn(f"{path}: offset 4", message)
            self.assertIn("checksum", message)

    def test_points_with_impossible_numbers(self):
        good = ball(50)
        for name, value in (("z", math.inf), ("y", -1e302), ("nx", math.nan), ("radius", -1.0),
                            ("radius", math.nan), ("radius", math.inf), ("radiance_g", -0.5),
                            ("radiance_b", math.nan)):
            for place in (0, 49):
                points = [list(p) for p in good]
                points[place][CORE.index(name)] = value
                path = self.here / "bad.ply"
                write_ply(path, points)
                self.refuse("cloud", path, f"point {place}")

    def test_points_without_a_place_or_a_normal_are_no_errors(self):
        points = [list(p) for p in ball(50)]
        points[7][CORE.index("x")] = math.nan
        points[20][3:6] = [0, 0, 0]
        path = self.here / "gaps.ply"
        write_ply(path, points)
        said = self.succeed("ptcbuild", path, "-o", self.here / "gaps.ptcx").stderr
        self.assertIn("1 records name no place and are left out", said)
        self.assertIn("the normals of 1 points are estimated", said)

    def test_lines_with_impossible_numbers(self):
        path = self.here / "bad.xyz"
        good = "0 0 0 0 1 0 0.1 1 1 1\n"
        for bad in ("inf 0 0 0 1 0 0.1 1 1 1", "0 0 0 0 1 0 -0.1 1 1 1",
                    "0 0 0 0 1 0 0.1 1 -1 1", "0 0 0 0 1 0 0.1 1 1", "0 0 0 0 1 zero 0.1 1 1 1"):
            path.write_text(good * 3 + bad + "\n" + good)
            self.refuse("cloud", path, "line 4")

    def test_meshes_with_impossible_numbers(self):
        path = self.here / "bad.obj"
        for bad in (BOX.replace("v 1 0 1", "v nan 0 1"), BOX.replace("f 4 3 2 1", "f 4 3 2 99"),
                    BOX.replace(" 0 ", " 1e302 "),
                    BOX.split("f ")[0], "f 1 2 3\n"):
            path.write_text(bad)
            self.refuse("mesh", path)

    def test_a_cloud_is_no_mesh(self):
        message = self.fail_with(1, "ptcrender", self.scene, "--mesh", self.cloud, "-o", self.here / "o.png")
        self.assertIn(str(self.cloud), message)

    def test_what_stood_under_the_name_of_the_output_stays(self):
        noise = self.here / "noise.ptcx"
        noise.write_bytes(b"not a container" * 1000)
        for kind in ("cloud", "container"):
            for command in self.consumers(kind):
                outputs = [w for w in command if isinstance(w, Path) and w.name.startswith("out.")]
                for output in outputs:
                    output.write_text("precious")
                    arguments = [noise if word == "{}" else word for word in command]
                    self.fail_with(1, *arguments)
                    self.assertEqual(output.read_text(), "precious")
                    output.unlink()


if __name__ == "__main__":
    unittest.main()
