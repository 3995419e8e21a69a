"""Compares what ptcconvert makes of LAZ, COPC and E57 files with what packages of npm read: laz-perf, copc (which takes
the nodes of a file from its hierarchy, and decodes them by laz-perf) and web-e57.

Run: npm_peer.py PTCCONVERT SOURCE_DIR. Environment: PTC_NODE_MODULES, the folder whose node_modules has the packages
(default: where node looks for those of this folder); PTC_SHARED, the folder of real files (default: "../shared" next to
the sources). The exit code is 77, which CTest counts as skipped, without node, one of the packages or the real files.
"""

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CONVERT, SOURCE = sys.argv[1:3]
HERE = Path(__file__).resolve().parent
PACKAGES = os.environ.get("PTC_NODE_MODULES", str(HERE))
POINTS = Path(os.environ.get("PTC_SHARED", Path(SOURCE).parent / "shared")) / "data" / "points"
COPC = "lion_takanawa.copc.laz"
LAZ = {"ahn3_cropped_1.laz": 640_510, "autzen-ept-10.65M.laz": 10_653_336, "autzen_trim.laz": 110_000, COPC: 341_989,
       "pine_plot.laz": 114_024}
E57 = {"bunnyDouble.e57": 30_571, "bunnyInt21.e57": 30_571, "tinyCartesianFloatRgb.e57": 2_090,
       "tiny_spherical.e57": 180}
MOST = 1_000_000  # points that are all compared; of larger files the first of every 97
SIZES = {0: 20, 1: 28, 2: 26, 3: 34, 6: 30, 7: 36}  # bytes of a record without extra bytes
TIMES, COLOURS = {1: 20, 3: 20, 6: 22, 7: 22}, {2: 20, 3: 28, 7: 30}  # places in the record


def read_by(work, *arguments):
    """Runs npm_peer.mjs. Returns what it writes."""
    command = ["node", HERE / "npm_peer.mjs", PACKAGES, work, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{work} {arguments}: {done.stderr.decode()}")
    return done.stdout


def skip_without_peers():
    reason = None
    if not shutil.which("node"):
        reason = "node is not installed"
    elif not POINTS.is_dir():
        reason = "the folder of real files is not on this machine"
    else:
        try:
            read_by("check")
        except RuntimeError:
            reason = ("laz-perf, copc or web-e57 is not installed: npm install laz-perf copc web-e57, and name the "
                      "folder in PTC_NODE_MODULES")
    if reason:
        print("skipped:", reason)
        sys.exit(77)


def scales_of(data):
    """Returns the scales and the offsets of the header of a LAS or LAZ file."""
    return struct.unpack_from("<6d", data, 131)


def split_las(data):
    """Returns point format, bytes of a record and the records of a LAS 1.4 file."""
    start, number, length = *struct.unpack_from("<I", data, 96), *struct.unpack_from("<BH", data, 104)
    count, = struct.unpack_from("<Q", data, 247)
    return number, length, data[start:start + count * length]


def fields_of(records, number, length):
    """Returns the columns of bytes of each field of records; those of formats before 6 as later ones have them."""
    def bits(at, low, count):
        return [records[at::length].translate(bytes(byte >> low & (1 << count) - 1 for byte in range(256)))]

    def whole(at, size):
        return [records[at + k::length] for k in range(size)]

    def angle_of_degrees(at):
        degrees = [byte - 256 if byte > 127 else byte for byte in range(256)]
        steps = [struct.pack("<h", round(angle / 0.006)) for angle in degrees]
        return [records[at::length].translate(bytes(step[k] for step in steps)) for k in range(2)]

    fields = {"x": whole(0, 4), "y": whole(4, 4), "z": whole(8, 4), "intensity": whole(12, 2),
              "user data": whole(17, 1)}
    if number >= 6:
        fields |= {"return number": bits(14, 0, 4), "number of returns": bits(14, 4, 4), "flags": bits(15, 0, 3),
                   "overlap": bits(15, 3, 1), "channel": bits(15, 4, 2), "scan direction": bits(15, 6, 1),
                   "edge of flight line": bits(15, 7, 1), "class": whole(16, 1), "angle": whole(18, 2),
                   "source": whole(20, 2)}
    else:
        fields |= {"return number": bits(14, 0, 3), "number of returns": bits(14, 3, 3), "flags": bits(15, 5, 3),
                   "scan direction": bits(14, 6, 1), "edge of flight line": bits(14, 7, 1), "class": bits(15, 0, 5),
                   "angle": angle_of_degrees(16), "source": whole(18, 2)}
    if number in TIMES:
        fields["gps time"] = whole(TIMES[number], 8)
    if number in COLOURS:
        fields["rgb"] = whole(COLOURS[number], 6)
    if length > SIZES[number]:
        fields["extra bytes"] = whole(SIZES[number], length - SIZES[number])
    return fields


def read_ply(data):
    """Returns the points of a binary PLY that ptcconvert wrote: a dictionary of values for each."""
    head, _, body = data.partition(b"end_header\n")
    properties = [line.split()[1:] for line in head.decode().splitlines() if line.startswith("property")]
    record = struct.Struct("<" + "".join({"double": "d", "float": "f", "uchar": "B"}[kind] for kind, _ in properties))
    return [dict(zip((name for _, name in properties), values)) for values in record.iter_unpack(body)]


class Peer(unittest.TestCase):
    def convert(self, name, ending, *options):
        """Returns the bytes that ptcconvert makes of a real file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / ("converted" + ending)
            done = subprocess.run([CONVERT, POINTS / name, path, "--quiet", *map(str, options)], capture_output=True,
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            return path.read_bytes()

    def compare_fields(self, ours, theirs):
        """Compares the fields that their records have."""
        for field, columns in theirs.items():
            for ours_of_byte, theirs_of_byte in zip(ours[field], columns, strict=True):
                if ours_of_byte != theirs_of_byte:
                    self.assertEqual(len(ours_of_byte), len(theirs_of_byte))
                    first = next(i for i, pair in enumerate(zip(ours_of_byte, theirs_of_byte)) if pair[0] != pair[1])
                    self.fail(f"{field} of point {first} differs")

    def compare_points(self, ours, theirs):
        """Compares lists of points; assertEqual would take minutes to show how long ones differ."""
        self.assertEqual(len(ours), len(theirs))
        wrong = next((pair for pair in zip(ours, theirs) if pair[0] != pair[1]), None)
        self.assertIsNone(wrong, "the first points that differ")

    def test_laz_is_read_as_laz_perf_reads_it(self):
        self.assertEqual(sorted(path.name for path in POINTS.glob("*.laz")), sorted(LAZ))
        for name, count in LAZ.items():
            with self.subTest(file=name):
                every = 97 if count > MOST else 1
                line, _, records = read_by("laz", POINTS / name, every).partition(b"\n")
                facts = json.loads(line)
                self.assertEqual(facts["count"], count)
                las = self.convert(name, ".las", "--every", every)
                self.assertEqual(scales_of(las), scales_of((POINTS / name).read_bytes()))
                number, length, mine = split_las(las)
                self.assertEqual(len(mine), -(-count // every) * length)
                theirs = fields_of(records, facts["format"], facts["length"])
                self.compare_fields(fields_of(mine, number, length), theirs)
                print(f"  {name}: {len(mine) // length} of {count} points, {len(theirs)} fields: {', '.join(theirs)}")

    def test_copc_is_read_as_copc_reads_it(self):
        line, _, values = read_by("copc", POINTS / COPC).partition(b"\n")
        facts = json.loads(line)
        self.assertEqual(facts["count"], LAZ[COPC])
        self.assertEqual(facts["dimensions"], [
            "X", "Y", "Z", "Intensity", "ReturnNumber", "NumberOfReturns", "Synthetic", "KeyPoint", "Withheld",
            "Overlap", "ScannerChannel", "ScanDirectionFlag", "EdgeOfFlightLine", "Classification", "UserData",
            "ScanAngle", "PointSourceId", "GpsTime", "Red", "Green", "Blue", "OriginId"])
        theirs = sorted(struct.iter_unpack(f"<{len(facts['dimensions'])}d", values))
        self.assertEqual(len(theirs), LAZ[COPC])
        las = self.convert(COPC, ".las")
        number, length, records = split_las(las)
        self.assertEqual((number, length), (7, 40))
        scale, offset = scales_of(las)[:3], scales_of(las)[3:]
        mine = []
        for x, y, z, intensity, returns, flags, kind, user, angle, source, time, red, green, blue, origin in (
                struct.iter_unpack("<3iH4BhHd3HI", records)):
            place = [value * scale[k] + offset[k] for k, value in enumerate((x, y, z))]
            mine.append((*place, intensity, returns & 15, returns >> 4, flags & 1, flags >> 1 & 1, flags >> 2 & 1,
                         flags >> 3 & 1, flags >> 4 & 3, flags >> 6 & 1, flags >> 7, kind, user, angle * 0.006, source,
                         time, red, green, blue, origin))
        self.compare_points(sorted(mine), theirs)
        print(f"  {COPC}: {len(mine)} points of {facts['nodes']} nodes, {len(facts['dimensions'])} fields")

    def test_e57_is_read_as_web_e57_reads_it(self):
        for name, count in E57.items():
            with self.subTest(file=name):
                theirs = [[float(word) for word in line.split()] for line in read_by("e57", POINTS / name).splitlines()]
                mine = read_ply(self.convert(name, ".ply"))
                self.assertEqual((len(mine), len(theirs)), (count, count))
                places, colours = ([[point[key] for key in keys if key in point] for point in mine]
                                   for keys in ("xyz", ("red", "green", "blue")))
                if name == "tiny_spherical.e57":  # sines and cosines may differ in the last bit
                    self.assertTrue(all(abs(a - b) < 4e-15 for pair in zip(places, theirs) for a, b in zip(*pair)))
                else:
                    self.compare_points(places, [point[:3] for point in theirs])
                self.compare_points(colours, [point[3:] for point in theirs])
                print(f"  {name}: {count} points, {len(theirs[0])} fields")


if __name__ == "__main__":
    skip_without_peers()
    unittest.main(argv=sys.argv[:1])
