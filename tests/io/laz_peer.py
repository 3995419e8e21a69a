"""Compares what las_dump prints of LAS and LAZ files with what laspy and lazrs read, field by field.

The files are the real ones of the shared data, if this machine has them, and clouds of every point
format that laspy writes here. Run: laz_peer.py LAS_DUMP SOURCE_DIR. Without laspy, lazrs and numpy
it ends with exit code 77, which CTest counts as skipped.
"""

import io
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import laspy
    import lazrs
    import numpy as np
except ImportError as error:
    print("skipped:", error)
    sys.exit(77)

DUMP, SOURCE = None, None
HAS_RGB = {2: 20, 3: 28, 5: 28, 7: 30, 8: 30, 10: 30}  # place in the record


def read_ours(path):
    """Returns the facts, positions, albedos and rows; of a file that is refused, {"refused": why}."""
    done = subprocess.run([DUMP, path], capture_output=True, check=False)
    assert done.returncode in (0, 1), (path, done.returncode, done.stderr)
    if done.returncode == 1:
        return {"refused": done.stderr.decode()}, None, None, None
    line, _, points = done.stdout.partition(b"\n")
    facts = json.loads(line)
    count = facts["count"]
    bytes_ = np.frombuffer(points, np.uint8).reshape(count, -1) if count else np.zeros((0, 36), np.uint8)
    place = np.ascontiguousarray(bytes_[:, :24]).view("<f8")
    albedo = np.ascontiguousarray(bytes_[:, 24:36]).view("<f4")
    return facts, place, albedo, bytes_[:, 36:]


def rows_of(records, number):
    """Returns the rows that records (n x bytes) of a point format must give."""
    returns, third = records[:, 14], records[:, 15]
    if number >= 6:
        head = [returns & 15, returns >> 4, third >> 6 & 1, third >> 7, records[:, 16], third & 15, third >> 4 & 3]
        rest = records[:, 17:]
    else:
        head = [returns & 7, returns >> 3 & 7, returns >> 6 & 1, returns >> 7, third & 31, third >> 5]
        rest = records[:, 16:]
    return np.hstack([records[:, 12:14], np.stack(head, 1), rest])


def srgb_to_linear(value):
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def compare(test, path):
    """Compares a file; returns "same", "refused" (by us alone) or "unread" (by both)."""
    try:
        las = laspy.read(path)
        number = las.header.point_format.id
        records = np.frombuffer(las.points.array.tobytes(), np.uint8).reshape(len(las.points), -1)
    except BaseException:  # pylint: disable=broad-except; lazrs panics with one of its own
        las = None
    facts, place, albedo, rows = read_ours(path)
    if "refused" in facts:
        return "refused: " + facts["refused"] if las else "unread"
    if las is None:
        return "read by us alone"
    test.assertEqual(facts["count"], len(records), path)
    if not len(records):
        return "same"
    stored = np.ascontiguousarray(records[:, :12]).view("<i4").astype(np.float64)
    test.assertTrue(np.array_equal(place, stored * las.header.scales + las.header.offsets), path)
    expected = rows_of(records, number)
    test.assertEqual(rows.shape, expected.shape, path)
    wrong = np.argwhere(rows != expected)
    test.assertEqual(len(wrong), 0, f"{path}: first difference at point, byte {wrong[:1]}")
    if facts["has_albedo"]:
        at = HAS_RGB[number]
        rgb = np.ascontiguousarray(records[:, at:at + 6]).view("<u2")
        most = 255 if rgb.max() < 256 else 65535
        test.assertLess(np.abs(srgb_to_linear(rgb / most) - albedo).max(), 1e-6, path)
    else:
        test.assertTrue(np.all(albedo == 0.5), path)
    return "same"


def random_records(number, extra, count, seed, channels=4):
    """Returns records whose fields change as those of scans do, and some that change at random."""
    rng = np.random.default_rng(seed)
    size = lazrs_point_size(number, extra)
    records = np.zeros((count, size), np.uint8)

    def put(at, values, dtype):
        data = np.ascontiguousarray(values.astype(dtype))
        records[:, at:at + data.itemsize] = data.view(np.uint8).reshape(count, -1)

    def rarely(values, often):
        """Keeps a value for a while: takes a new one at one of `often` points."""
        change = rng.integers(0, often, count) == 0
        change[0] = True
        return values[np.maximum.accumulate(np.where(change, np.arange(count), 0))]

    wild = rng.integers(0, 50, count) == 0
    for axis in range(3):
        steps = rng.integers(-300, 300, count) + np.where(wild, rng.integers(-2**30, 2**30, count), 0)
        put(4 * axis, np.cumsum(steps), np.int32)
    put(12, rarely(rng.integers(0, 65536, count), 3), np.uint16)
    late = number >= 6
    if late:
        n = rng.integers(0, 16, count)
        r = np.where(rng.integers(0, 3, count) == 0, rng.integers(0, 16, count), np.minimum(n, 1 + np.arange(count) % 16))
        put(14, r | n << 4, np.uint8)
        channel = rarely(rng.integers(0, channels, count), 20)
        put(15, rarely(rng.integers(0, 16, count), 9) | channel << 4 | rarely(rng.integers(0, 4, count), 9) << 6, np.uint8)
        put(16, rarely(rng.integers(0, 256, count), 9), np.uint8)
        put(17, rarely(rng.integers(0, 256, count), 9), np.uint8)
        put(18, rarely(rng.integers(-32768, 32768, count), 4), np.int16)
        put(20, rarely(rng.integers(0, 65536, count), 99), np.uint16)
        at = 22
    else:
        put(14, rarely(rng.integers(0, 256, count), 2), np.uint8)
        put(15, rarely(rng.integers(0, 256, count), 9), np.uint8)
        put(16, rarely(rng.integers(-128, 128, count), 4), np.int8)
        put(17, rarely(rng.integers(0, 256, count), 9), np.uint8)
        put(18, rarely(rng.integers(0, 65536, count), 99), np.uint16)
        at = 20
    if number not in (0, 2):
        # Four sequences of times with steps of their own, some jumps, some odd steps.
        which = rarely(rng.integers(0, 4, count), 30)
        times = np.zeros(count)
        for k in range(4):
            step = rng.integers(0, 12, count) * [0.25, 1e-5, 0.001, 3.0][k]
            step = np.where(rng.integers(0, 40, count) == 0, rng.normal(0, 10.0, count), step)
            times = np.where(which == k, 1e5 * k + np.cumsum(step), times)
        times = np.where(rng.integers(0, 500, count) == 0, rng.normal(0, 1e12, count), times)
        put(at, rarely(times, 2), np.float64)
        at += 8
    if number in HAS_RGB:
        for c in range(3):
            put(at + 2 * c, rarely(rng.integers(0, 65536, count), 2), np.uint16)
        grey = rng.integers(0, 5, count) == 0
        records[grey, at + 2:at + 4] = records[grey, at:at + 2]
        records[grey, at + 4:at + 6] = records[grey, at:at + 2]
        at += 6
    if number in (8, 10):
        put(at, rarely(rng.integers(0, 65536, count), 2), np.uint16)
        at += 2
    if number in (4, 5, 9, 10):
        put(at, rarely(rng.integers(0, 256, count), 9), np.uint8)
        how = rng.integers(0, 4, count)
        size = rarely(rng.integers(0, 1000, count), 5)
        put(at + 1, np.cumsum(np.choose(how, [np.zeros(count, np.int64), np.roll(size, 1), rng.integers(-999, 999, count),
                                              rng.integers(-2**40, 2**40, count)])), np.uint64)
        put(at + 9, size, np.uint32)
        for k in range(4):
            put(at + 13 + 4 * k, rarely(rng.normal(0, 1, count), 2), np.float32)
        at += 29
    for k in range(extra):
        put(at + k, rarely(rng.integers(0, 256, count), 2 + k), np.uint8)
    return records


def lazrs_point_size(number, extra):
    return [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67][number] + extra


def header_of(number, extra, count, laszip):
    """Returns the header of a LAZ file with one record, "laszip encoded"."""
    size = 375 if number >= 6 else 235
    u16, u32 = (lambda v: v.to_bytes(2, "little")), (lambda v: v.to_bytes(4, "little"))
    out = b"LASF" + bytes(20) + bytes([1, 4 if number >= 6 else 3]) + bytes(68) + u16(size)
    out += u32(size + 54 + len(laszip)) + u32(1) + bytes([number | 128]) + u16(lazrs_point_size(number, extra))
    out += u32(0 if number >= 6 else count) + bytes(20) + np.array([0.01, 0.001, 1, 5, -7, 0], "<f8").tobytes()
    out = out.ljust(247, b"\0") + count.to_bytes(8, "little") if number >= 6 else out
    out = out.ljust(size, b"\0")
    return out + u16(0) + b"laszip encoded\0\0" + u16(22204) + u16(len(laszip)) + bytes(32) + laszip


def write_laz(path, number, extra, records, chunks):
    """Writes a LAZ file by lazrs; `chunks` are the numbers of points of variable chunks, or None."""
    vlr = lazrs.LazVlr.new_for_compression(number, extra, chunks is not None)
    stream = io.BytesIO()
    stream.write(header_of(number, extra, len(records), bytes(vlr.record_data())))
    compressor = lazrs.LasZipCompressor(stream, vlr)
    done = 0
    for count in chunks or [len(records)]:
        compressor.compress_many(np.ascontiguousarray(records[done:done + count]).tobytes())
        done += count
        if chunks and done < len(records):
            compressor.finish_current_chunk()
    compressor.done()
    Path(path).write_bytes(stream.getvalue())


def write_by_laszip(path, number, extra, records):
    """Writes a LAZ file by LASzip, in chunks of 50000 points."""
    header = laspy.LasHeader(point_format=number, version="1.4" if number >= 6 else "1.3")
    if extra:
        header.add_extra_dim(laspy.ExtraBytesParams("extra", f"{extra}u1"))
    las = laspy.LasData(header)
    points = np.frombuffer(records.tobytes(), header.point_format.dtype()).copy()
    las.points = laspy.ScaleAwarePointRecord(points, header.point_format, header.scales, header.offsets)
    las.write(path, laz_backend=laspy.LazBackend.Laszip)


class Peer(unittest.TestCase):
    def compare_rows(self, path, number, records):
        facts, _, _, rows = read_ours(path)
        self.assertNotIn("refused", facts, path)
        wrong = np.argwhere(rows != rows_of(records, number))
        self.assertEqual(len(wrong), 0, f"{path}: first difference at point, byte {wrong[:1]}")

    def test_real_files_are_read_alike(self):
        shared = Path(os.environ.get("PTC_SHARED", Path(SOURCE).parent / "shared")) / "data"
        if not shared.is_dir():
            self.skipTest("the folder of real files is not on this machine")
        for path in sorted([*shared.glob("points/*.la[sz]"), *shared.glob("odd/las-laz/*.la[sz]")]):
            print(f"  {path.name}: {compare(self, str(path))}")

    def test_every_format_is_read_as_it_was_written(self):
        with tempfile.TemporaryDirectory() as folder:
            for number in range(11):
                for extra in (0, 3):
                    # lazrs and LASzip disagree on wave packets where the scanner channel changes.
                    channels = 1 if number >= 9 else 4
                    records = random_records(number, extra, 60_000, 100 * number + extra, channels)
                    path = str(Path(folder) / f"format{number}-{extra}.laz")
                    for chunks in (None, [1, 2, 999, 30_000, 28_998]):
                        write_laz(path, number, extra, records, chunks)
                        self.compare_rows(path, number, records)

    def test_one_wide_colour_at_the_end_of_a_small_file_is_seen_on_opening(self):
        records = random_records(2, 0, 60_000, 5)
        records[:, 21::2] = 0  # the high bytes
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "colours.laz")
            for wide, bits in ((0, 8), (1, 16)):
                records[-1, 21] = wide
                write_laz(path, 2, 0, records, None)
                facts, _, _, _ = read_ours(path)
                self.assertEqual(json.loads(facts["text"]["las.header"])["colour_bits"], bits)

    def test_what_laszip_writes_is_read(self):
        if not laspy.LazBackend.Laszip.is_available():
            self.skipTest("the package laszip is not installed")
        with tempfile.TemporaryDirectory() as folder:
            for number in range(11):
                for extra in (0, 3):
                    records = random_records(number, extra, 60_000, 100 * number + extra)
                    path = str(Path(folder) / f"laszip{number}-{extra}.laz")
                    write_by_laszip(path, number, extra, records)
                    self.compare_rows(path, number, records)

    def test_a_chunk_of_a_million_points_is_read(self):
        with tempfile.TemporaryDirectory() as folder:
            records = random_records(3, 0, 1_100_000, 1)
            path = str(Path(folder) / "large.laz")
            write_laz(path, 3, 0, records, [5, 1_000_000, 99_995])
            self.compare_rows(path, 3, records)


if __name__ == "__main__":
    DUMP, SOURCE = sys.argv.pop(1), sys.argv.pop(1)
    unittest.main()
