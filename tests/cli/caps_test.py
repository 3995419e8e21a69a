"""Resident memory stays within the cap and 64 MiB, whatever the input: accepted or refused."""

import array
import json
import math
import os
import struct
import subprocess
import tempfile
import unittest
import zlib

from programs import BIN, ProgramTest

MIB = 1 << 20
SLACK = 64 * MIB


class Caps(ProgramTest):
    def peak(self, code, cap, program, *arguments):
        """Runs a program under a cap of so many MiB. Checks its exit code and its peak; returns what it said."""
        command = [str(BIN / program), *map(str, arguments), "--memory", f"{cap}M"]
        with tempfile.TemporaryFile() as said:
            child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            said.seek(0)
            text = said.read().decode()
        self.assertEqual(child.returncode, code, f"{command}: {text}")
        self.assertLessEqual(usage.ru_maxrss * 1024, cap * MIB + SLACK, f"{command}: {text}")
        return text

    def write_waves(self, path, side, ground=0):
        """Writes a PLY of 2 side^2 triangles over the unit square, and one more below it, so many units wide."""
        places, faces = array.array("f"), bytearray()
        for i in range(side + 1):
            for k in range(side + 1):
                places.extend((i / side, 0.05 * math.sin(0.05 * i) * math.cos(0.04 * k), k / side))
        for i in range(side):
            for k in range(side):
                a, b = i * (side + 1) + k, (i + 1) * (side + 1) + k
                for corners in ((a, a + 1, b + 1), (a, b + 1, b)):
                    faces += b"\x03" + array.array("i", corners).tobytes()
        if ground:
            faces += b"\x03" + array.array("i", (len(places) // 3 + i for i in range(3))).tobytes()
            places.extend((-ground, -0.1, -ground, -ground, -0.1, ground, ground, -0.1, -ground))
        header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(places) // 3}\nproperty float x\n"
                  f"property float y\nproperty float z\nelement face {len(faces) // 13}\n"
                  "property list uchar int vertex_indices\nend_header\n")
        path.write_bytes(header.encode() + places.tobytes() + faces)

    def test_a_mesh_larger_than_the_cap_is_built(self):
        mesh = self.here / "waves.ply"
        self.write_waves(mesh, 900)  # 1.6 million triangles: 230 MB while they are read into memory
        said = self.peak(0, 128, "ptcbuild", mesh, "--points", "20k", "-o", self.here / "o.ptcx")
        self.assertIn("the meshes do not fit in memory", said)
        self.succeed("ptcverify", self.here / "o.ptcx")

    def test_thousands_of_triangles_on_each_surfel_stay_within_the_cap(self):
        mesh = self.here / "waves.ply"
        for points, ground in (("200", 0), ("200k", 50)):  # what is near a surfel was all of the mesh
            self.write_waves(mesh, 700, ground)
            self.peak(0, 128, "ptcbuild", mesh, "--points", points, "--no-default-lights", "-o", self.here / "o.ptcx")

    def test_a_mesh_that_fits_is_seen_and_not_its_surfels(self):
        mesh = self.here / "waves.ply"
        self.write_waves(mesh, 700)  # a million triangles: 33 MB of mesh and some 80 of rays
        said = self.peak(0, 512, "ptcrender", self.scene, "--mesh", mesh, "--size", "64x36", "-o", self.here / "o.png")
        self.assertNotIn("do not fit", said)

    def test_128_mib_are_enough_for_any_number_of_threads(self):
        mesh = self.here / "small.ply"
        for side in (20, 70, 200):
            self.write_waves(mesh, side)
            for threads in (1, 2, 3, 16):
                self.peak(0, 128, "ptcbuild", mesh, "--points", "2k", "--threads", threads, "-o", self.here / "o.ptcx")

    def test_large_pictures_are_written_row_by_row(self):
        picture = ["--size", "2400x1600", "--samples", "1", "-o", self.here / "o.exr", "-o", self.here / "o.png"]
        for scene, cap in (([self.cloud], 224), ([self.mesh, "--points", "3k"], 160)):
            self.peak(0, cap, "ptcrender", *scene, *picture)
            self.assertGreater((self.here / "o.exr").stat().st_size, 100_000)

    def test_textures_and_skies_larger_than_the_cap_go_through_tiles(self):
        side = 8192
        chunk = lambda name, data: struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        pixels, row = zlib.compressobj(1), bytes(v for x in range(side) for v in (x & 255, x >> 6, 128))
        data = b"".join(pixels.compress(b"\0" + row) for _ in range(side)) + pixels.flush()
        (self.here / "wide.png").write_bytes(
            b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", data) + chunk(b"IEND", b""))
        row = bytes((2, 2, side >> 8, side & 255)) + 4 * (bytes((255, 128)) * (side // 127) + bytes((128 + side % 127, 128)))
        (self.here / "sky.hdr").write_bytes(
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (side // 2, side) + row * (side // 2))
        (self.here / "floor.mtl").write_text("newmtl floor\nmap_Kd wide.png\n")
        (self.here / "floor.obj").write_text(
            "mtllib floor.mtl\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
            "usemtl floor\nf 1/1 4/4 3/3 2/2\n")
        scene = self.here / "floor.ptcx"
        said = self.peak(0, 160, "ptcbuild", self.here / "floor.obj", "--points", "3k", "--sky", self.here / "sky.hdr",
                         "-o", scene)
        self.assertNotIn("wide.png", said)
        self.peak(0, 160, "ptclight", scene, "-o", self.here / "lit.ptcx")
        self.peak(0, 160, "ptcrender", scene, "--mesh", self.here / "floor.obj", "--size", "64x36", "-o",
                  self.here / "o.exr")
        said = self.peak(5, 40, "ptcbuild", self.here / "floor.obj", "--sky", self.here / "sky.hdr", "-o", scene)
        self.assertIn("the picture of the sky", said)

    def test_a_sparse_buffer_of_a_gltf_is_not_taken_into_memory(self):
        count = 20_000_000
        with open(self.here / "s.bin", "wb") as file:
            file.truncate(12 * count)
        (self.here / "s.gltf").write_text(json.dumps({
            "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 12 * count}],
            "buffers": [{"uri": "s.bin", "byteLength": 12 * count}]}))
        said = self.peak(1, 128, "ptcbuild", self.here / "s.gltf", "-o", self.here / "o.ptcx")
        self.assertIn("s.gltf: the mesh has no triangle", said)
        self.assertFalse((self.here / "o.ptcx").exists())

    def test_a_gltf_that_is_nested_too_deep_is_refused(self):
        (self.here / "deep.gltf").write_text('{"a":' + "[" * 2_000_000 + "]" * 2_000_000 + "}")
        said = self.peak(1, 128, "ptcbuild", self.here / "deep.gltf", "-o", self.here / "o.ptcx")
        self.assertIn("deep.gltf: its JSON is nested more than 128 deep", said)

    def test_a_gltf_whose_json_does_not_fit_is_refused(self):
        (self.here / "wide.gltf").write_text('{"a":[' + "0," * 4_000_000 + "0]}")
        said = self.peak(5, 128, "ptcbuild", self.here / "wide.gltf", "-o", self.here / "o.ptcx")
        self.assertIn("its JSON does not fit in --memory", said)


if __name__ == "__main__":
    unittest.main()
