#!/usr/bin/env python3
"""Prints the demo's page of figures from the files that its programs wrote to a directory."""
import json
import pathlib
import sys

out = pathlib.Path(sys.argv[1])


def facts(name):
    """What a program printed with --json."""
    return json.loads((out / f"{name}.json").read_text())


def wall(run):
    """Seconds of wall time of all stages of a program together."""
    seconds = run["seconds"]
    return seconds["total"] if isinstance(seconds, dict) else seconds


build, verify, shade, render, check = (facts(n) for n in ("build", "verify", "shade", "render", "check"))
scene_bytes = (out / "scene.ptcx").stat().st_size

print("# Demo\n")
print(f"{build['points']:,} surfels, {build['nodes']:,} nodes, {scene_bytes / 2**20:.1f} MiB in `scene.ptcx`.\n")
print("| stage | wall s | CPU s | peak MiB | cap MiB |")
print("|---|---|---|---|---|")
for name, run in (("build", build), ("verify", verify), ("shade", shade), ("render", render)):
    peak, cap = (run[key] / 2**20 for key in ("peak_resident_bytes", "memory_bytes"))
    print(f"| {name} | {wall(run):.1f} | {run['cpu_seconds']:.1f} | {peak:.0f} | {cap:.0f} |")

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
