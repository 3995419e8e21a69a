"""What other programs read in the files that the writers of points write.

writers_peer.py WRITE_SAMPLES TEMP_DIR: runs WRITE_SAMPLES, and compares every value of its files with the formula that it
writes them by. laspy reads LAS, usd-core USD, open3d PLY and PCD; numpy alone reads PLY, PCD, ptc and bgeo by their layouts.
Each package that is missing skips its part; without numpy all is skipped, with exit code 77.
"""

import subprocess
import sys
import unittest
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    print("skipped:", error)
    sys.exit(77)

COUNT = 5000
ORIGINS = {"near": (0, 0, 0), "far": (637000, 848000, 400)}
FOLDER = None


def optional(name):
    """Returns a module, or None where it is not installed."""
    try:
        return __import__(name, fromlist=["x"])
    except ImportError as error:
        print("left out:", error)
        return None


def columns(name):
    """Returns what the points hold: the name of each quantity and an array with a row for each point."""
    i = np.arange(COUNT)
    odd = (i % 2 == 1)[:, None]
    f = i.astype(np.float64)
    zero, one = np.zeros(COUNT), np.ones(COUNT)
    return {
        "position": np.stack([i % 100 + 0.25, i // 100 * 0.5, i % 64 * 0.125], 1) + ORIGINS[name],
        "normal": np.where(odd, np.float32([0.6, -0.8, 0]), np.float32([0, 0, 1])),
        "radius": 0.5 + f / 8192,
        "radiance": np.stack([f, 2 * f, 0.125 * one], 1),
        "albedo": np.stack([i % 9 / 8, one, zero], 1),
        "emission": np.stack([zero, f, 3 * one], 1),
        "intensity": 7 * i % 65536,
        "return_number": 1 + i % 3,
        "number_of_returns": 3 + 0 * i,
        "classification": i % 200,
        "scan_angle": i - 2500,
        "gps_time": 1e8 + f / 8,
        "rgb": np.stack([3 * i, 65535 - i, 257 * (i % 256)], 1),
        "nir": 5 * i,
        "occlusion": i % 65 / 64,
        "bent_normal": np.tile([0, 0.5, -1], (COUNT, 1)),
        "sky": np.stack([f, -f, zero], 1) / 16,
        "id": i.astype(np.uint64) << np.uint64(33),
        "tilt": -3 * i,
        "pair": np.stack([i % 100, -(i % 100)], 1),
    }


CHANNELS = list(columns("near"))[6:]
AXES = {"normal", "bent_normal"}


def parts(name, values):
    """Returns the names of the components of a quantity, and their values."""
    if values.ndim == 1:
        return [(name, values)]
    ends = "01" if values.shape[1] == 2 else "xyz" if name in AXES else "rgb"
    return [(f"{name}_{end}", values[:, k]) for k, end in enumerate(ends)]


class Peers(unittest.TestCase):
    def same(self, found, wanted, tolerance=0, what=""):
        found, wanted = np.asarray(found), np.asarray(wanted)
        self.assertEqual(found.shape, wanted.shape, what)
        if tolerance == 0:
            self.assertTrue(np.array_equal(found, wanted), what)
        else:
            self.assertLessEqual(np.max(np.abs(found.astype(np.float64) - wanted)), tolerance, what)

    def test_laspy_reads_las(self):
        laspy = optional("laspy")
        if laspy is None:
            self.skipTest("laspy is not installed")
        for name in ORIGINS:
            wanted = columns(name)
            las = laspy.read(FOLDER / f"{name}.las")
            self.assertEqual((las.header.version.major, las.header.version.minor), (1, 4))
            self.assertEqual(las.header.point_format.id, 8)
            self.assertEqual(las.header.point_count, COUNT)
            self.assertEqual(list(las.header.number_of_points_by_return[:3]),
                             [int(np.sum(wanted["return_number"] == k)) for k in (1, 2, 3)])
            xyz = np.asarray(las.xyz)
            self.same(xyz, wanted["position"], 1e-6, "position")
            self.same(las.header.mins, xyz.min(0), 1e-9)
            self.same(las.header.maxs, xyz.max(0), 1e-9)
            for field in ("intensity", "return_number", "number_of_returns", "classification", "scan_angle", "gps_time", "nir"):
                self.same(las[field], wanted[field], 0, field)
            for k, field in enumerate(("red", "green", "blue")):
                self.same(las[field], wanted["rgb"][:, k], 0, field)
            extra = set(las.point_format.extra_dimension_names)
            for quantity in ("normal", "radius", "radiance", "emission", "occlusion", "bent_normal", "sky", "id", "pair"):
                for field, values in parts(quantity, wanted[quantity]):
                    self.same(las[field], values, 0, field)
                    extra.remove(field)
            self.same(np.asarray(las["tilt"]), wanted["tilt"] * 0.5 + 3, 0, "tilt")
            self.assertEqual(extra, {"tilt"})
            self.assertTrue(las.header.global_encoding.wkt)
            self.assertIn("LOCAL_CS", [v for v in las.vlrs if v.record_id == 2112][0].string)
            record, = las.evlrs
            self.assertEqual((record.user_id, record.record_id), ("peer", 7))
            self.assertEqual(record.record_data_bytes(), bytes(k * k >> 3 & 255 for k in range(70_000)))

    def test_usd_reads_usda_and_usdc(self):
        Usd = optional("pxr.Usd")
        if Usd is None:
            self.skipTest("usd-core is not installed")
        from pxr import Sdf, UsdGeom
        for name in ORIGINS:
            wanted = columns(name)
            texts = []
            for ending in ("usda", "usdc"):
                path = str(FOLDER / f"{name}.{ending}")
                stage = Usd.Stage.Open(path)
                texts.append(Sdf.Layer.FindOrOpen(path).ExportToString().split("\n", 1)[1])
                self.assertEqual(UsdGeom.GetStageUpAxis(stage), "Z")
                self.assertEqual(UsdGeom.GetStageMetersPerUnit(stage), 0.3048)
                points = UsdGeom.Points(stage.GetDefaultPrim())
                self.assertTrue(points)
                place = np.array(points.GetPointsAttr().Get()).astype(np.float64)
                moved = UsdGeom.XformCache().GetLocalToWorldTransform(points.GetPrim())
                self.same(place + np.array(moved.ExtractTranslation()), wanted["position"], 1e-5 if name == "far" else 0)
                self.same(points.GetNormalsAttr().Get(), wanted["normal"])
                self.assertEqual(points.GetNormalsInterpolation(), "vertex")
                self.same(points.GetWidthsAttr().Get(), 2 * wanted["radius"])
                extent = np.array(points.GetExtentAttr().Get())
                exact = np.array(UsdGeom.Points.ComputeExtent(points.GetPointsAttr().Get(), points.GetWidthsAttr().Get()))
                self.assertTrue(np.all(extent[0] <= exact[0]) and np.all(extent[1] >= exact[1]))
                primvars = UsdGeom.PrimvarsAPI(points.GetPrim())
                self.same(points.GetDisplayColorAttr().Get(), wanted["albedo"])
                for quantity in ["radiance", "emission"] + CHANNELS:
                    primvar = primvars.GetPrimvar(quantity)
                    self.assertEqual(primvar.GetInterpolation(), "vertex", quantity)
                    self.same(primvar.Get(), wanted[quantity], 0, quantity)
                self.assertEqual(primvars.GetPrimvar("sky").GetTypeName(), "color3f[]")
                self.assertEqual(primvars.GetPrimvar("bent_normal").GetTypeName(), "normal3f[]")
            self.assertEqual(*texts)

    def compare_fields(self, table, wanted, names, tolerance=0):
        for quantity, prefix in names.items():
            values = wanted[quantity]
            ends = parts(quantity, values) if prefix is None else list(zip(prefix, np.atleast_2d(values.T)))
            for field, column in ends:
                self.same(table[field], column, tolerance if quantity == "position" else 0, field)

    def test_numpy_reads_ply(self):
        kinds = {"double": "<f8", "float": "<f4", "uchar": "u1", "char": "i1", "ushort": "<u2", "short": "<i2", "uint": "<u4",
                 "int": "<i4"}
        for name in ORIGINS:
            head, _, data = (FOLDER / f"{name}.ply").read_bytes().partition(b"end_header\n")
            lines = [line.split() for line in head.decode().splitlines()]
            table = np.frombuffer(data, [(w[2], kinds[w[1]]) for w in lines if w[0] == "property"])
            names = {"position": "xyz", "normal": ("nx", "ny", "nz"), "albedo": ("albedo_r", "albedo_g", "albedo_b")}
            names |= {q: None for q in ["radius", "radiance", "emission"] + CHANNELS}
            self.compare_fields(table, columns(name), names)
            self.assertEqual([table.dtype[n].str for n in ("id", "rgb_r", "pair_1", "occlusion")], ["<f8", "<u2", "|i1", "<f4"])

    def test_numpy_reads_pcd(self):
        for name in ORIGINS:
            head, _, data = (FOLDER / f"{name}.pcd").read_bytes().partition(b"DATA binary\n")
            lines = {line.split()[0]: line.split()[1:] for line in head.decode().splitlines()}
            table = np.frombuffer(data, [(n, f"<{k.lower()}{s}") for n, k, s in
                                         zip(lines["FIELDS"], lines["TYPE"], lines["SIZE"])])
            self.assertEqual(lines["POINTS"], [str(COUNT)])
            self.assertEqual(lines["SIZE"][0], {"near": "4", "far": "8"}[name])
            wanted = columns(name)
            self.compare_fields(table, wanted, {"position": "xyz"} | {q: None for q in [
                "normal", "radius", "radiance", "emission"] + CHANNELS if q != "rgb"})
            self.compare_fields(table, wanted, {"rgb": None})
            linear = wanted["albedo"]
            curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
            eight = np.rint(curve * 255).astype(np.uint32)
            self.same(table["rgb"].view("<u4"), eight[:, 0] << 16 | eight[:, 1] << 8 | eight[:, 2])

    def test_open3d_reads_ply_and_pcd(self):
        open3d = optional("open3d")
        if open3d is None:
            self.skipTest("open3d is not installed")
        for name in ORIGINS:
            wanted = columns(name)
            for ending in ("ply", "pcd"):
                path = str(FOLDER / f"{name}.{ending}")
                cloud = open3d.io.read_point_cloud(path)
                self.same(np.asarray(cloud.normals), wanted["normal"], 0, ending)
                if (name, ending) == ("far", "pcd"):  # doubles are for the newer functions only
                    cloud = open3d.t.io.read_point_cloud(path).to_legacy()
                self.same(np.asarray(cloud.points), wanted["position"], 0, ending)

    def test_numpy_reads_ptc(self):
        for name in ORIGINS:
            wanted = columns(name)
            data = (FOLDER / f"{name}.ptc").read_bytes()
            self.assertEqual(data[:4], b"pptc")
            self.assertEqual(np.frombuffer(data, "<f8", 1, 8)[0], COUNT)
            box = np.frombuffer(data, "<f4", 6, 16).reshape(2, 3)
            self.same(box, np.float32([wanted["position"].min(0), wanted["position"].max(0)]))
            variables, floats = np.frombuffer(data, "<u4", 2, 180)
            at, fields = 188, [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("phi", "<u2"), ("height", "<u2"), ("radius", "<f4")]
            for _ in range(variables):
                end = data.index(b"\n", at)
                kind, field = data[at:end].decode().split()
                fields.append((field, "<f4") if kind == "float" else (field, "<f4", 3))
                at = end + 1
            table = np.frombuffer(data, fields, COUNT, at)
            self.assertEqual(at + table.nbytes, len(data))
            self.assertEqual(table.dtype.itemsize, 20 + 4 * floats)
            self.same(np.stack([table[a] for a in "xyz"], 1), np.float32(wanted["position"]))
            turn, z = 2 * np.pi * (table["phi"] / 65535 - 0.5), table["height"] / 32767.5 - 1
            ring = np.sqrt(1 - z * z)
            self.same(np.stack([ring * np.sin(turn), ring * np.cos(turn), z], 1), wanted["normal"], 1e-4)
            self.same(table["radius"], wanted["radius"])
            self.same(table["_area"], np.float32(2 * wanted["radius"] ** 2), 1e-6)
            self.same(table["_radiosity"], wanted["radiance"] + wanted["emission"])
            self.same(table["_albedo"], wanted["albedo"])
            for quantity in CHANNELS:
                found = np.stack([table["pair_0"], table["pair_1"]], 1) if quantity == "pair" else table[quantity]
                self.same(found, wanted[quantity].astype(np.float32), 0, quantity)

    def test_numpy_reads_bgeo(self):
        for name in ORIGINS:
            wanted = columns(name)
            data = (FOLDER / f"{name}.bgeo").read_bytes()
            self.assertEqual(data[:5], b"BgeoV")
            head = np.frombuffer(data, ">i4", 9, 5)
            self.assertEqual(list(head[:5]), [5, COUNT, 0, 0, 0])
            at, fields = 41, [("P", ">f4", 3), ("w", ">f4")]
            for _ in range(head[5]):
                length = int(np.frombuffer(data, ">u2", 1, at)[0])
                field = data[at + 2:at + 2 + length].decode()
                at += 2 + length
                numbers, kind = int(np.frombuffer(data, ">u2", 1, at)[0]), int(np.frombuffer(data, ">i4", 1, at + 2)[0])
                fields.append((field, ">i4" if kind == 1 else ">f4", numbers))
                at += 6 + 4 * numbers
            table = np.frombuffer(data, fields, COUNT, at)
            self.assertEqual(data[at + table.nbytes:], b"\0\xff")
            self.same(table["P"], np.float32(wanted["position"]))
            self.same(table["N"], wanted["normal"])
            self.same(table["Cd"], wanted["albedo"])
            self.same(table["pscale"][:, 0], wanted["radius"])
            for quantity in ["radiance", "emission"] + CHANNELS:
                values = wanted[quantity]
                if quantity == "id":
                    values = np.minimum(values, 2**31 - 1)
                if quantity == "gps_time":
                    values = np.float32(values)
                self.same(table[quantity].reshape(values.shape), values, 0, quantity)

    def test_numpy_reads_xyz(self):
        for name in ORIGINS:
            path = FOLDER / f"{name}.xyz"
            with open(path, encoding="ascii") as file:
                names = file.readline()[2:].split()
            table = np.loadtxt(path, dtype=np.float64)
            double = {"x", "y", "z", "gps_time"}
            found = {field: table[:, k] if field in double else np.float32(table[:, k]) for k, field in enumerate(names)}
            self.assertEqual(len(found), table.shape[1])
            wanted = columns(name)
            # Text has what scaled values mean
            wanted["scan_angle"] = np.float32(wanted["scan_angle"] * 0.006)
            wanted["tilt"] = np.float32(wanted["tilt"] * 0.5 + 3)
            self.same(np.stack([found[f"n{a}"] for a in "xyz"], 1), wanted["normal"])
            self.compare_fields(found, wanted, {"position": "xyz"} | {q: None for q in [
                "radius", "radiance", "albedo", "emission"] + CHANNELS})


if __name__ == "__main__":
    FOLDER = Path(sys.argv[2])
    subprocess.run([sys.argv[1], FOLDER], check=True)
    unittest.main(argv=sys.argv[:1])
