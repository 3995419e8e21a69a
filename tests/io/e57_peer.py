"""Compares the E57 reader with libE57Format, by way of pye57: every point of files that pye57 writes and of real files.

Environment: PTC_DUMP_E57, the program dump_e57; PTC_SOURCE, the root of the sources; PTC_SHARED, the folder of real
files (default: "../shared" next to the sources). The exit code is 77 where pye57 is not installed.
"""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import pye57
    from pye57 import libe57
except ImportError:
    print("skipped: pye57 is not installed")
    sys.exit(77)

DUMP = os.environ["PTC_DUMP_E57"]
SHARED = pathlib.Path(os.environ.get("PTC_SHARED", pathlib.Path(os.environ["PTC_SOURCE"]).parent / "shared")) / "data"
TYPES = {1: "u1", 2: "<u2", 3: "<f2", 4: "<f4", 5: "<u4", 6: "<u8", 7: "i1", 8: "<i2", 9: "<i4", 10: "<i8", 11: "<f8"}


def read(path):
    """Returns the facts and the points, a structured array, that the reader under test gives."""
    done = subprocess.run([DUMP, str(path)], capture_output=True, check=True)
    line, _, data = done.stdout.partition(b"\n")
    facts = json.loads(line)
    row = [("position", "<f8", (3,)), ("normal", "<f4", (3,)), ("albedo", "<f4", (3,))]
    for channel in facts["channels"]:
        shape = (channel["components"],) if channel["components"] > 1 else ()
        row.append((channel["name"], TYPES[channel["type"]], shape))
    points = np.frombuffer(data, dtype=np.dtype(row))
    assert len(points) == facts["points"]
    return facts, points


def linear(share):
    """Returns the linear values of sRGB shares."""
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def rotated(rotation, points):
    """Turns points by a unit quaternion w x y z."""
    w, axis = rotation[0], np.asarray(rotation[1:])
    return points + 2 * np.cross(axis, np.cross(axis, points) + w * points)


def libe57_scan(e57, index):
    """Returns what libE57Format reads of a scan: fields by name, whether it has a pose, rotation and translation."""
    header = e57.get_header(index)
    prototype = libe57.StructureNode(header.points.prototype())
    values, buffers = {}, libe57.VectorSourceDestBuffer()
    for i in range(prototype.childCount()):
        node = prototype.get(i)
        whole = node.type() == libe57.NodeType.E57_INTEGER  # longlong, because pye57 takes int64 for 32 bits
        values[node.elementName()] = np.zeros(header.point_count, np.longlong if whole else np.float64)
        buffers.append(libe57.SourceDestBuffer(e57.image_file, node.elementName(), values[node.elementName()],
                                               header.point_count, True, True))
    if header.point_count:
        header.points.reader(buffers).read()
    return values, header


def three(values, names):
    return np.stack([values[name] for name in names], axis=1)


NAMES = {"rowIndex": "row", "columnIndex": "column", "returnIndex": "return_number", "returnCount": "number_of_returns",
         "timeStamp": "time_stamp"}


class Peer(unittest.TestCase):
    def compare(self, path):
        """Compares every point and channel of a file with what libE57Format reads. Returns the number of points."""
        facts, points = read(path)
        channels = {channel["name"]: channel for channel in facts["channels"]}
        e57 = pye57.E57(str(path))
        at = left_out = 0
        for index in range(e57.scan_count):
            values, header = libe57_scan(e57, index)
            keep = self.keep(values)
            count = int(keep.sum())
            left_out += len(keep) - count
            mine = points[at:at + count]
            at += count
            values = {name: column[keep] for name, column in values.items()}
            self.compare_places(values, header, mine)
            if e57.scan_count > 1:
                self.assertTrue((mine["scan"] == index).all())
            if "colorRed" in values:
                self.compare_colours(values, mine)
            self.compare_channels(values, mine, channels)
        self.assertEqual(at, len(points))
        self.assertEqual(left_out, facts["left_out"])
        e57.close()
        return at

    @staticmethod
    def keep(values):
        """Returns which records have a place."""
        keep = np.ones(len(next(iter(values.values()))), bool)
        cartesian = "cartesianX" in values
        state = "cartesianInvalidState" if cartesian else "sphericalInvalidState"
        if state in values:
            keep &= values[state] == 0
        for name in values:
            if name.startswith("cartesian" if cartesian else "spherical") and name != state:
                keep &= ~np.isnan(values[name])
        return keep

    def compare_places(self, values, header, mine):
        if "cartesianX" in values:
            local = three(values, ["cartesianX", "cartesianY", "cartesianZ"])
        else:
            r, azimuth, elevation = (values["spherical" + name] for name in ("Range", "Azimuth", "Elevation"))
            local = np.stack([r * np.cos(elevation) * np.cos(azimuth), r * np.cos(elevation) * np.sin(azimuth),
                              r * np.sin(elevation)], axis=1)
        exact = "cartesianX" in values
        rotation, move = np.array([1.0, 0, 0, 0]), np.zeros(3)
        if header.has_pose():
            node = header.node["pose"]
            if node.isDefined("rotation"):
                rotation = np.array([node["rotation"][name].value() for name in "wxyz"])
            if node.isDefined("translation"):
                move = np.array([node["translation"][name].value() for name in "xyz"])
        rotation = rotation / np.linalg.norm(rotation)
        expected = rotated(rotation, local) + move
        if exact and rotation[0] == 1:
            self.assertTrue((mine["position"] == expected).all())
        elif len(mine):
            most = max(1.0, np.abs(expected).max())
            self.assertLess(np.abs(mine["position"] - expected).max(), 4e-15 * most)
        if "nor:normalX" in values:
            normals = rotated(rotation, three(values, ["nor:normalX", "nor:normalY", "nor:normalZ"]))
            lengths = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
            self.assertLess(np.abs(mine["normal"] - normals).max(), 1e-6)

    def compare_colours(self, values, mine):
        colours = three(values, ["colorRed", "colorGreen", "colorBlue"])
        self.assertTrue((mine["rgb"] == colours).all())
        self.assertLess(np.abs(mine["albedo"] - linear(colours / (65535 if colours.max() > 255 else 255))).max(), 1e-6)

    def compare_channels(self, values, mine, channels):
        compared = 0
        for name, column in values.items():
            channel = channels.get(NAMES.get(name, name.lower()))
            if channel is None:
                continue
            stored = mine[channel["name"]]
            if stored.dtype == np.int64 or stored.dtype == np.uint64:
                self.assertTrue((stored.astype(np.int64) == column).all(), name)
            else:
                real = stored.astype(np.float64) * channel["scale"] + channel["offset"] - (name == "returnIndex")
                self.assertTrue(np.array_equal(real, column.astype(np.float64), equal_nan=True), name)
            compared += 1
        self.compared = getattr(self, "compared", 0) + compared


class Real(Peer):
    @unittest.skipUnless(SHARED.is_dir(), "the folder of real files is not on this machine")
    def test_every_point_of_the_real_files_is_equal(self):
        counts = {"bunnyDouble": 30571, "bunnyInt21": 30571, "tinyCartesianFloatRgb": 2090, "tiny_spherical": 180}
        for name, count in counts.items():
            self.assertEqual(self.compare(SHARED / "points" / (name + ".e57")), count, name)

    @unittest.skipUnless(SHARED.is_dir(), "the folder of real files is not on this machine")
    def test_what_libe57_reads_of_the_odd_files_is_equal(self):
        files = 0
        for path in sorted((SHARED / "odd/e57").glob("*.e57")):
            if "corrupt_crc" in path.name:
                with self.assertRaises(subprocess.CalledProcessError):
                    read(path)
                continue
            self.compare(path)
            files += 1
        self.assertEqual(files, 10)


class Written(Peer):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.scratch.name) / "a.e57"
        self.random = np.random.default_rng(1)

    def tearDown(self):
        self.scratch.cleanup()

    def write_scan(self, e57, nodes, columns, rotation=None, translation=None):
        """Adds a scan. `nodes` makes the field of each name of `columns`, its bounds those of the column."""
        imf = e57.image_file
        scan, prototype = libe57.StructureNode(imf), libe57.StructureNode(imf)
        scan.set("guid", libe57.StringNode(imf, str(e57.scan_count)))
        if rotation is not None:
            pose = libe57.StructureNode(imf)
            for part, names, numbers in (("rotation", "wxyz", rotation), ("translation", "xyz", translation)):
                node = libe57.StructureNode(imf)
                for name, number in zip(names, numbers):
                    node.set(name, libe57.FloatNode(imf, float(number)))
                pose.set(part, node)
            scan.set("pose", pose)
        count = len(next(iter(columns.values())))
        columns = {name: column.astype(np.float64 if column.dtype.kind == "f" else np.longlong)
                   for name, column in columns.items()}
        buffers = libe57.VectorSourceDestBuffer()
        for name, column in columns.items():
            prototype.set(name, nodes[name](imf))
            buffers.append(libe57.SourceDestBuffer(imf, name, column, count, True, True))
        points = libe57.CompressedVectorNode(imf, prototype, libe57.VectorNode(imf, True))
        scan.set("points", points)
        e57.data3d.append(scan)
        writer = points.writer(buffers)
        writer.write(count)
        writer.close()

    def xyz(self, count, kind):
        names = ["cartesianX", "cartesianY", "cartesianZ"]
        columns = {name: self.random.uniform(-900, 900, count) for name in names}
        return {name: kind for name in names}, columns

    @staticmethod
    def double(imf):
        return libe57.FloatNode(imf, 0.0, libe57.FloatPrecision.E57_DOUBLE)

    @staticmethod
    def single(imf):
        return libe57.FloatNode(imf, 0.0, libe57.FloatPrecision.E57_SINGLE)

    @staticmethod
    def integer(low, high):
        return lambda imf: libe57.IntegerNode(imf, int(low), int(low), int(high))

    @staticmethod
    def scaled(low, high, scale, offset):
        return lambda imf: libe57.ScaledIntegerNode(imf, int(low), int(low), int(high), scale, offset)

    def test_scans_with_poses_and_different_fields(self):
        with pye57.E57(str(self.path), mode="w") as e57:
            e57.image_file.extensionsAdd("nor", "http://www.libe57.org/E57_NOR_surface_normals.txt")
            nodes, columns = self.xyz(20000, self.double)
            for name in ("colorRed", "colorGreen", "colorBlue"):
                nodes[name], columns[name] = self.integer(0, 255), self.random.integers(0, 256, 20000, dtype=np.int64)
            for axis in "XYZ":
                nodes["nor:normal" + axis] = self.single
                columns["nor:normal" + axis] = self.random.uniform(-1, 1, 20000)
            nodes["intensity"], columns["intensity"] = self.single, self.random.uniform(0, 1, 20000)
            self.write_scan(e57, nodes, columns, [0.5, -0.5, 0.5, 0.5], [1000.25, -2000, 3])
            nodes, columns = self.xyz(30001, self.scaled(-(1 << 20), (1 << 20) - 1, 0.001, 0.125))
            nodes["intensity"], columns["intensity"] = self.integer(0, 2047), self.random.integers(0, 2048, 30001)
            nodes["rowIndex"], columns["rowIndex"] = self.integer(5, 1000), self.random.integers(5, 1001, 30001)
            nodes["returnIndex"], columns["returnIndex"] = self.integer(0, 3), self.random.integers(0, 4, 30001)
            nodes["timeStamp"], columns["timeStamp"] = self.double, np.arange(30001) / 7
            nodes["cartesianInvalidState"] = self.integer(0, 2)
            columns["cartesianInvalidState"] = self.random.integers(0, 3, 30001)
            self.write_scan(e57, nodes, columns, [math.sqrt(0.5), 0, 0, -math.sqrt(0.5)], [5e6, 4e5, 0])
            self.write_scan(e57, *self.xyz(1, self.single))
        self.assertGreater(self.compare(self.path), 25000)
        self.assertGreaterEqual(self.compared, 5)

    def test_colours_of_16_bits(self):
        with pye57.E57(str(self.path), mode="w") as e57:
            nodes, columns = self.xyz(5000, self.double)
            for name in ("colorRed", "colorGreen", "colorBlue"):
                nodes[name], columns[name] = self.integer(0, 65535), self.random.integers(0, 65536, 5000)
            self.write_scan(e57, nodes, columns)
        self.assertEqual(self.compare(self.path), 5000)

    def test_integers_of_every_width(self):
        for width in range(0, 64):
            low = int(self.random.integers(-1000, 1000)) if width < 62 else -(1 << 62)
            high = min(low + (1 << width) - 1, (1 << 63) - 1)
            with pye57.E57(str(self.path), mode="w") as e57:
                nodes, columns = self.xyz(3000, self.single)
                nodes["a"] = self.integer(low, high)
                columns["a"] = self.random.integers(low, high, 3000, endpoint=True)
                self.write_scan(e57, nodes, columns)
            with self.subTest(width=width):
                self.compared = 0
                self.assertEqual(self.compare(self.path), 3000)
                self.assertEqual(self.compared, 1)
            self.path.unlink()

    def test_a_scan_that_pye57_writes_itself(self):
        count = 12345
        data = {name: self.random.uniform(-50, 50, count) for name in ("cartesianX", "cartesianY", "cartesianZ")}
        data["intensity"] = self.random.uniform(0, 1, count)
        for name in ("colorRed", "colorGreen", "colorBlue"):
            data[name] = self.random.integers(0, 256, count).astype(np.uint8)
        data["rowIndex"] = self.random.integers(0, 777, count).astype(np.uint16)
        data["columnIndex"] = self.random.integers(3, 9, count).astype(np.uint16)
        with pye57.E57(str(self.path), mode="w") as e57:
            e57.write_scan_raw(data, rotation=np.array([0.6, 0, 0.8, 0]), translation=np.array([1, 2, 3]))
            e57.write_scan_raw(data)
        self.assertEqual(self.compare(self.path), 2 * count)


if __name__ == "__main__":
    unittest.main()
