"""A full disk, and inputs that change while they are read."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from harness import INPUTS, OLD

INSIDE = "PTC_FAULTS_INSIDE"  # set in a name space where file systems may be mounted


def enter_name_space():
    """Returns the unshare command that lets this user mount a tmpfs, or None."""
    for options in (["-m"], ["-rm"]):
        probe = ["unshare", *options, "mount", "-t", "tmpfs", "none", "/mnt"]
        if subprocess.run(probe, stderr=subprocess.DEVNULL, check=False).returncode == 0:
            return ["unshare", *options]
    return None


def mount(directory, size):
    subprocess.run(["umount", directory], stderr=subprocess.DEVNULL, check=False)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", directory], check=True)


def free_blocks(directory):
    return os.statvfs(directory).f_bfree


def pages(data):
    return -(-len(data) // 4096)


def fill(place, arguments, tally):
    """Makes the disk of the target, then that of temporary files, too small by various amounts."""
    if not place.target:
        return
    temp = place.home / "temp"
    old, new = pages(OLD), pages(place.new)
    sizes = [4096 * count for count in (old, old + new // 2, old + new - 1, 2 * (old + new) + 256)]
    trials = [(place.out, size) for size in sizes]
    if place.scenario.slow or "bounces" in place.scenario.name:
        trials += [(temp, size) for size in (4096, 1 << 14, 1 << 20, 10 << 20, 25 << 20, 200 << 20)]
    codes = []
    for directory, size in trials:
        mount(directory, size)
        place.reset()
        before = free_blocks(directory)
        run = place.run(reset=False)
        codes.append(f"{run.code}")
        wrong = place.complaints_alone(run)
        if run.code not in (0, 3) or (run.code == 3 and "No space left on device" not in run.errors):
            wrong.append(f"exit {run.code}")
        if run.code == 3 and (str(directory) not in run.errors or place.target.read_bytes() != OLD):
            wrong.append("the message does not tell where, or the old file is gone")
        if run.code == 3 and free_blocks(directory) != before and not place.scenario.keeps:
            wrong.append("room is lost")
        if run.code == 3 and place.scenario.keeps:
            subprocess.run(["mount", "-o", "remount,size=200M", directory], check=True)
            wrong += place.complaints(place.run(reset=False))
        for text in wrong:
            tally.fail(f"{place.scenario}: {size} bytes for {directory.name}: {text}: {run.errors.strip()}")
        subprocess.run(["umount", directory], check=True)
    if place.scenario.name == "build spread" and set(codes[len(sizes):]) != {"0"}:
        tally.fail(f"{place.scenario}: the other directory has room: {codes}")
    if codes[len(sizes) - 1] != "0" or codes[-1] != "0" or "3" not in codes:
        tally.fail(f"{place.scenario}: no size was too small, or none large enough: {codes}")
    print(f"  {place.scenario}: exit codes by growing size: {' '.join(codes)}", flush=True)


def truncate_half(path):
    os.truncate(path, path.stat().st_size // 2)


def truncate_all(path):
    os.truncate(path, 0)


def overwrite(path):
    with path.open("r+b") as file:
        file.write(os.urandom(path.stat().st_size))


def replace(path):
    other = path.with_name("other")
    other.write_bytes(b"another file\n" * 3000)
    other.rename(path)


def remove(path):
    path.unlink()


CHANGES = [truncate_half, truncate_all, overwrite, replace, remove]


def run_changed(place, at, path, change):
    """Stops the run before call `at`, changes the input, and lets it go on."""
    path.unlink(missing_ok=True)
    path.write_bytes(INPUTS[path.name])
    process = place.start(how="stop", at=at)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
    change(path)
    process.send_signal(signal.SIGCONT)
    return place.end(process)


def disturb(place, arguments, tally):
    """Cuts, overwrites, replaces or removes the input before each call."""
    names = [Path(word).name for word in place.scenario.command if word.startswith("{in}/") and "." in word]
    if not names or not place.preloaded:
        return
    path = place.home / names[0]
    count = place.run(how="stop").calls
    told = []
    for change in CHANGES:
        if change == overwrite and path.suffix != ".ptcx":
            continue  # without checksums other values are as good
        if change in (truncate_half, truncate_all) and "mapped" in place.scenario.name:
            continue  # SIGBUS, as the option says
        codes = []
        for at in arguments.steps(count, place.most(arguments, 7, 1)):
            run = run_changed(place, at, path, change)
            codes.append(run.code)
            wrong = place.complaints(run)
            gone = change == remove and run.code == 3 and "No such file" in run.errors
            refused = (1, 6) if str(place.scenario) == "verify" else (1,)
            if (run.code not in (0, *refused) and not gone) or (run.code != 0 and str(path) not in run.errors):
                wrong.append("neither done nor exit 1 with the file's name")
            for text in wrong:
                tally.fail(f"{place.scenario}: {change.__name__} before call {at}: {text};"
                           f" exit {run.code}: {run.errors.strip()[:300]}")
        told.append(f"{change.__name__} {codes.count(0)} done {codes.count(1) + codes.count(6)} refused")
    print(f"  {place.scenario}: {', '.join(told)}", flush=True)


def inside_name_space(arguments):
    """Returns true inside the name space. Outside, runs this program again inside, or says why it cannot."""
    if os.environ.get(INSIDE):
        return True
    command = enter_name_space()
    if command is None:
        print("  skipped: this user may mount no tmpfs here")
        return False
    command += [sys.executable, "-B", sys.argv[0], "disk", *arguments.options]
    code = subprocess.run(command, env={**os.environ, INSIDE: "1"}, check=False).returncode
    if code != 0:
        sys.exit(code)
    return False
