#!/usr/bin/env python3
"""Prints the demo's page of figures from the files that its programs wrote to a directory."""
import json
import pathlib
import re
import sys

out = pathlib.Path(sys.argv[1])


def facts(name):
    """What a program printed with --json."""
    return json.loads((out / f"{name}.json").read_text())


def peak_mib(name):
    """Peak resident set in MiB, as GNU time measured it."""
    text = (out / f"{name}.time").read_text()
    return int(re.search(r"Maximum resident set size \(kbytes\): (\d+)", text).group(1)) / 1024


def wall(name):
    """Seconds of wall time."""
    text = (out / f"{name}.time").read_text()
    parts = re.search(r"Elapsed \(wall clock\) time.*: ([\d:.]+)", text).group(1).split(":")
    return sum(float(p) * 60**i for i, p in enumerate(reversed(parts)))


def cpu(name):
    """Seconds of CPU time, user and system together."""
    text = (out / f"{name}.time").read_text()
    return sum(float(re.search(rf"{kind} time \(seconds\): ([\d.]+)", text).group(1)) for kind in ("User", "System"))


build, shade, render, check = (facts(n) for n in ("build", "shade", "render", "check"))
scene_bytes = (out / "scene.ptcx").stat().st_size

print("# Demo\n")
print(f"{build['points']:,} surfels, {build['nodes']:,} nodes, {scene_bytes / 2**20:.1f} MiB in `scene.ptcx`.\n")
print("| stage | wall s | CPU s | peak MiB | cap |")
print("|---|---|---|---|---|")
for name, cap in (("build", "256M"), ("verify", "2G"), ("shade", "256M"), ("render", "256M")):
    print(f"| {name} | {wall(name):.1f} | {cpu(name):.1f} | {peak_mib(name):.0f} | {cap} |")

print("\n| gather | receivers | us of CPU each | page lookups | hit rate | read MiB |")
print("|---|---|---|---|---|---|")
for name, run in (("all surfels", shade), ("picture", render)):
    cache = run["cache"]
    print(
        f"| {name} | {run['receivers']:,} | {run['shade_cpu_seconds'] * 1e6 / max(1, run['receivers']):.0f} "
        f"| {cache['lookups']:,} | {100 * cache['hit_rate']:.3f} % | {cache['bytes_read'] / 2**20:.0f} |"
    )

report = check["check"]
print(f"\nError at {report['receivers']:,} receivers of the picture against {report['rays']:,} rays each:\n")
print("| against | occlusion RMS | bias | mean | irradiance RMS / mean | bias / mean | rays: us of CPU a receiver |")
print("|---|---|---|---|---|---|---|")
for name, key in (("the same surfels", "discs"), ("the mesh", "mesh")):
    if key not in report:
        continue
    e = report[key]
    micro = report["disc_microseconds" if key == "discs" else "mesh_microseconds"]
    print(
        f"| {name} | {e['occlusion_rms']:.4f} | {e['occlusion_bias']:+.4f} | {e['occlusion_mean']:.3f} "
        f"| {100 * e['irradiance_rms']:.1f} % | {100 * e['irradiance_bias']:+.1f} % | {micro:.0f} |"
    )
