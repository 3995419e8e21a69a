#!/usr/bin/env python3
"""Lights scenes larger than memory under a cap of 256 MiB, and writes spec/results/scenes.md.

    tools/scenes.py [--bin DIR] [--work DIR] [--results DIR] ANIMAL SCENE.glb SKY

ANIMAL is a mesh of some 70,000 triangles, such as the Stanford bunny, which is set into 100,000 places.
SCENE.glb is shown by a turntable under SKY, a picture in latitude and longitude. A height field of 20
million triangles is made in the work folder, which needs 600 MB. Nothing else should run on the machine
meanwhile. Needs the standard library only. Exit code 1 when a program fails.
"""
import argparse
import array
import datetime
import json
import math
import pathlib
import platform
import random
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SIDE = 3164  # vertices along an edge of the height field: 20,009,138 triangles
PLACES = 100_000
CAP = "256M"


def write_field(path):
    """Writes a height field of sines of nine octaves, 100 units wide, as binary PLY."""
    waves = []
    draw = random.Random(1)
    for octave in range(9):
        scale = 2 * math.pi * 2**octave / 100
        rows = [array.array("d", (math.sin(scale * 100 * i / (SIDE - 1) + phase) for i in range(SIDE)))
                for phase in (draw.random() * 6.28, draw.random() * 6.28)]
        waves.append((4 / 2**octave, *rows))
    with open(path, "wb") as out:
        out.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {SIDE * SIDE}\nproperty float x\n"
            f"property float y\nproperty float z\nelement face {2 * (SIDE - 1) ** 2}\n"
            "property list uchar int vertex_indices\nend_header\n".encode())
        width = [100 * i / (SIDE - 1) - 50 for i in range(SIDE)]
        for j in range(SIDE):
            weights = [(size * v[j], u) for size, u, v in waves]
            heights = [sum(w * u[i] for w, u in weights) for i in range(SIDE)]
            row = array.array("f", bytes(12 * SIDE))
            row[0::3] = array.array("f", width)
            row[1::3] = array.array("f", heights)
            row[2::3] = array.array("f", [width[j]]) * SIDE
            out.write(row.tobytes())
        faces = bytearray(26 * (SIDE - 1))
        faces[0::13] = b"\3" * (2 * (SIDE - 1))
        for j in range(SIDE - 1):
            corners = array.array("i", bytes(24 * (SIDE - 1)))
            first = range(j * SIDE, j * SIDE + SIDE - 1)
            for place, step in enumerate((0, SIDE, 1, 1, SIDE, SIDE + 1)):
                corners[place::6] = array.array("i", (i + step for i in first))
            packed = corners.tobytes()
            for byte in range(12):
                faces[1 + byte::13] = packed[byte::12]
            out.write(faces)


def write_forest(work, animal):
    """Writes a scene file of an animal in many places, each turned and of a size of its own."""
    draw = random.Random(2)
    side = round(math.sqrt(PLACES))
    with open(work / "places.txt", "w", encoding="ascii") as out:
        for i in range(PLACES):
            x, z = (i % side + draw.random()) * 0.25, (i // side + draw.random()) * 0.25
            turn = math.pi * draw.random()
            out.write(f"{x:.4f} 0 {z:.4f} 0 {math.sin(turn):.6f} 0 {math.cos(turn):.6f} {draw.choice((0.8, 1.1, 1.5))}\n")
    half = side * 0.25 / 2
    scene = {"ptcx_scene": 1,
             "camera": {"position": [half, 7, -8], "look_at": [half, 0, 10], "vertical_fov": 0.6},
             "objects": [{"file": str(animal.resolve()), "placements": "places.txt"}]}
    (work / "forest.scene.json").write_text(json.dumps(scene))


def run(bin_dir, work, program, *arguments):
    """Runs a program in the work folder. Returns its command and its facts."""
    words = [str(a) for a in arguments] + ["--memory", CAP]
    done = subprocess.run([bin_dir / program, *words, "--json"], cwd=work, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{program} {' '.join(words)}: exit code {done.returncode}\n{done.stderr}")
    return " ".join([program, *(pathlib.Path(w).name if "/" in w else w for w in words)]), json.loads(done.stdout)


def seconds_of(facts):
    """Seconds of wall time of all stages of a program together."""
    seconds = facts["seconds"]
    return seconds["total"] if isinstance(seconds, dict) and "total" in seconds else sum(seconds.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "build/scenes")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "spec/results")
    parser.add_argument("animal", type=pathlib.Path)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("sky", type=pathlib.Path)
    given = parser.parse_args()
    bin_dir, work, results = given.bin.resolve(), given.work.resolve(), given.results.resolve()
    work.mkdir(parents=True, exist_ok=True)
    load = pathlib.Path("/proc/loadavg").read_text().split()[0]
    if not (work / "field.ply").exists():
        write_field(work / "field.ply")
    write_forest(work, given.animal)

    frames = range(1, 25, 4)
    runs = [
        run(bin_dir, work, "ptcbuild", "field.ply", "--points", "1M", "-o", "field.ptcx"),
        run(bin_dir, work, "ptcrender", "field.ptcx", "--camera=-20,7,-45,5,0,10",
            "--size", "640x360", "-o", results / "scenes-field.png"),
        run(bin_dir, work, "ptcbuild", "forest.scene.json", "--points", "5M", "-o", "forest.ptcx"),
        run(bin_dir, work, "ptcrender", "forest.ptcx", "--camera-file", "forest.scene.json", "--size", "640x360",
            "-o", results / "scenes-forest.png"),
        run(bin_dir, work, "ptcrender", given.scene.resolve(), "--sky", given.sky.resolve(), "--points", "300k",
            "--turntable", 24, "--frames", "1-24x4", "--size", "320x180", "-o", results / "scenes-turn.##.png"),
    ]
    commit = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = [
        "# Scenes larger than memory", "",
        f"A height field of {2 * (SIDE - 1) ** 2:,} triangles, {PLACES:,} places of {given.animal.name}, and {len(frames)} frames of a "
        f"turntable of {given.scene.name} under {given.sky.name}, each lit end to end under a cap of 256 MiB. Lights are the default sun and "
        "sky, but for the last. Single runs; peak memory is that of the whole program.", "",
        "| | |", "|---|---|",
        f"| system | {platform.system()} {platform.release()} {platform.machine()} |",
        f"| load before | {load} running threads |",
        f"| commit | {commit.stdout.strip()} |",
        f"| date | {datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M} UTC |",
        "| command | `tools/scenes.py " + f"{given.animal.name} {given.scene.name} {given.sky.name}` |", "",
        "| command | surfels or receivers | wall s | CPU s | peak MiB |", "|---|---:|---:|---:|---:|"]
    for command, facts in runs:
        count = facts.get("receivers", facts.get("points", 0))
        lines.append(f"| `{command}` | {count:,} | {seconds_of(facts):.1f} | {facts['cpu_seconds']:.1f} "
                     f"| {facts['peak_resident_bytes'] / 2**20:.0f} |")
    lines += ["", "![20 million triangles](scenes-field.png)", "", "![100,000 places](scenes-forest.png)", "",
              " ".join(f"![frame {frame}](scenes-turn.{frame:02}.png)" for frame in frames), ""]
    (results / "scenes.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
