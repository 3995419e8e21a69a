"""Compares the readers of pictures with Pillow: PNG of every kind of pixel, also interlaced, JPEG, TGA and BMP; and HDR
with what numpy makes of its bytes.

Arguments: the program dump_picture. The exit code is 77 where Pillow or numpy are not installed.
"""

import io
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import numpy as np
    from PIL import Image
except ImportError:
    print("skipped: Pillow or numpy is not installed")
    sys.exit(77)

DUMP = sys.argv.pop(1)
# x and y of the first pixel of each pass of Adam7, and the steps between its pixels
ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def linear(share):
    """Returns the linear values of sRGB shares."""
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def smooth(width, height):
    """Returns an RGB picture of 8 bits with slopes, waves and a little noise, so that codecs have something to do."""
    y, x = np.mgrid[0:height, 0:width]
    noise = np.random.default_rng(1).integers(0, 20, (height, width))
    red = 127 + 100 * np.sin(x / 9 + y / 23) + noise
    return np.clip(np.stack([red, 255 * x / width, 255 * y / height], -1), 0, 255).astype(np.uint8)


def png(pixels, kind, bits, interlaced=False, palette=b""):
    """Returns a PNG. `pixels` is height x width x channels; `kind` its colour type in the header."""
    def packed(rows):
        lines = []
        for row in rows:
            if bits == 16:
                line = row.astype(">u2").tobytes()
            elif bits == 8:
                line = row.astype("u1").tobytes()
            else:
                width = np.array([int(v) for v in row.ravel()])
                places = np.unpackbits(width.astype("u1")[:, None], axis=1)[:, 8 - bits:]
                line = np.packbits(places.ravel()).tobytes()
            lines.append(b"\0" + line)
        return b"".join(lines)

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    height, width = pixels.shape[:2]
    passes = [pixels[y::down, x::right] for x, y, right, down in ADAM7] if interlaced else [pixels]
    data = b"".join(packed(part) for part in passes if part.size)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, interlaced)) +
            (chunk(b"PLTE", palette) if palette else b"") + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def hdr(values):
    """Returns an HDR with run lengths, of height x width x 4 bytes."""
    height, width = values.shape[:2]
    out = [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width)]
    for row in values:
        out.append(bytes([2, 2, width >> 8, width & 255]))
        for channel in row.T:
            at = 0
            while at < width:
                run = 1
                while at + run < width and run < 127 and channel[at + run] == channel[at]:
                    run += 1
                if run > 2:
                    out.append(bytes([128 + run, channel[at]]))
                else:
                    out.append(bytes([run]) + channel[at:at + run].tobytes())
                at += run
    return b"".join(out)


class Pictures(unittest.TestCase):
    """Each picture is read twice: into memory, and through tiles on the disk."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        # Half of 16 MiB, but for 608 bytes
        self.filler = pathlib.Path(self.folder.name) / "filler.png"
        self.filler.write_bytes(self.saved(Image.new("RGB", (2000, 1398)), "PNG"))

    def read(self, data, name):
        path = pathlib.Path(self.folder.name) / name
        path.write_bytes(data)
        results = []
        for more in ([], [str(self.filler)]):
            done = subprocess.run([DUMP, str(path), *more], capture_output=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            line, _, values = done.stdout.partition(b"\n")
            width, height = map(int, line.split())
            results.append(np.frombuffer(values, "<f4").reshape(height, width, 3))
        self.assertTrue(np.array_equal(*results))
        return results[0]

    def check_opacity(self, data, name, expected):
        """Checks the alpha of a picture, of 8 bits; none is to be found where all of it is 255."""
        path = pathlib.Path(self.folder.name) / name
        path.write_bytes(data)
        for more in ([], [str(self.filler)]):
            done = subprocess.run([DUMP, "--opacity", str(path), *more], capture_output=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            if np.all(expected == 255):
                self.assertEqual(done.stdout, b"")
                continue
            values = np.frombuffer(done.stdout.partition(b"\n")[2], "<f4").reshape(*expected.shape, 3)
            self.assertTrue(np.array_equal(np.round(values[..., 0] * 255), expected), name)

    def check(self, data, name, expected, most=0):
        """Checks against expected shares of sRGB, up to `most` steps of 8 bits."""
        got = self.read(data, name)
        self.assertEqual(got.shape, expected.shape)
        low, high = linear(np.clip(expected - most / 255, 0, 1)), linear(np.clip(expected + most / 255, 0, 1))
        self.assertTrue(np.all((got >= low - 1e-6) & (got <= high + 1e-6)), name)

    def saved(self, picture, format, **options):
        buffer = io.BytesIO()
        picture.save(buffer, format, **options)
        return buffer.getvalue()

    def test_png(self):
        for width, height in [(1, 1), (3, 2), (33, 7), (700, 500)]:
            rgb = smooth(width, height)
            grey, alpha = rgb[..., :1], 255 - rgb[..., 1:2]
            deep = rgb.astype(np.uint16) * 256 + rgb[..., ::-1]
            for interlaced in (False, True):
                shares = rgb / 255
                one = np.repeat(grey / 255, 3, -1)
                self.check(png(rgb, 2, 8, interlaced), "rgb.png", shares)
                self.check(png(np.concatenate([rgb, alpha], -1), 6, 8, interlaced), "rgba.png", shares)
                for data in (png(np.concatenate([rgb, alpha], -1), 6, 8, interlaced),
                             png(np.concatenate([grey, alpha], -1), 4, 8, interlaced), png(rgb, 2, 8, interlaced)):
                    self.check_opacity(data, "alpha.png", np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))[..., 3])
                self.check(png(grey, 0, 8, interlaced), "grey.png", one)
                self.check(png(np.concatenate([grey, alpha], -1), 4, 8, interlaced), "grey_alpha.png", one)
                self.check(png(deep, 2, 16, interlaced), "deep.png", deep / 65535)
                self.check(png(deep[..., :1], 0, 16, interlaced), "deep_grey.png", np.repeat(deep[..., :1] / 65535, 3, -1))
                for bits in (1, 2, 4):
                    steps = grey >> (8 - bits)
                    self.check(png(steps, 0, bits, interlaced), "few.png", np.repeat(steps / (2**bits - 1), 3, -1))
                    colours = np.random.default_rng(2).integers(0, 256, (2**bits, 3)).astype(np.uint8)
                    data = png(steps, 3, bits, interlaced, colours.tobytes())
                    self.check(data, "palette.png", colours[steps[..., 0]] / 255)
                    self.assertTrue(np.array_equal(np.asarray(Image.open(io.BytesIO(data)).convert("RGB")),
                                                   colours[steps[..., 0]]))

    def test_jpeg(self):
        # Both decode through libjpeg, but their versions may round by a step
        rgb = Image.fromarray(smooth(701, 503))
        for options in ({}, {"subsampling": 0}, {"subsampling": 2}, {"progressive": True}, {"quality": 30}):
            for mode in ("RGB", "L", "CMYK"):
                data = self.saved(rgb.convert(mode), "JPEG", **options)
                expected = np.asarray(Image.open(io.BytesIO(data)).convert("RGB")) / 255
                self.check(data, "a.jpg", expected, 2)

    def test_tga_and_bmp(self):
        rgb = smooth(300, 201)
        picture = Image.fromarray(rgb)
        self.check(self.saved(picture, "BMP"), "a.bmp", rgb / 255)
        self.check(self.saved(picture, "TGA"), "a.tga", rgb / 255)
        with_alpha = Image.fromarray(np.concatenate([rgb, 255 - rgb[..., :1]], -1))
        self.check_opacity(self.saved(with_alpha, "TGA"), "c.tga", 255 - rgb[..., 0])
        paletted = with_alpha.quantize(16)
        self.check_opacity(self.saved(paletted, "PNG"), "p.png", np.asarray(paletted.convert("RGBA"))[..., 3])
        self.check(self.saved(picture, "TGA", compression="tga_rle"), "b.tga", rgb / 255)

    def test_hdr(self):
        random = np.random.default_rng(3)
        for width, height in [(5, 3), (8, 1), (700, 501)]:
            values = random.integers(0, 256, (height, width, 4)).astype(np.uint8)
            values[..., 3] = random.integers(118, 140, (height, width))
            values[:, width // 2:] = values[:, width // 2:width // 2 + 1]  # runs
            values[0, 0, 0] = 3  # so that rows of few pixels are not taken for coded ones
            data = hdr(values) if width >= 8 else hdr(values[:, :0]).split(b"-Y")[0] + b"-Y %d +X %d\n" % (
                height, width) + values.tobytes()
            expected = values[..., :3] * 2.0 ** (values[..., 3:].astype(float) - 136)
            self.assertTrue(np.array_equal(self.read(data, "a.hdr"), expected.astype("<f4")))


if __name__ == "__main__":
    unittest.main()
