"""The files that a crash may leave: kill -9 at any moment, and power loss replayed from a trace of calls.

The replay models a file system that keeps no more than it promises: whatever was written to a file since
its last sync is on the disk in whole, in part, in any order or not at all, and so are changes of names
since the last sync of their directory.
"""

import os
import random
import signal
import time
from pathlib import Path

from harness import OLD

SECTOR = 512
SUPERBLOCKS = 2 * 4096  # at the end of a container


def read_trace(path):
    """Returns tuples of call, path, second path, offset and data, in the order of the calls."""
    data, at, calls = path.read_bytes(), 0, []
    while at < len(data):
        end = data.index(b"\n", at)
        call, offset, count, paths = data[at:end].decode().split(" ", 3)
        first, second = paths.split("\t")
        at = end + 1 + int(count)
        calls.append((call, first, second, int(offset), data[end + 1:at]))
    return calls


class File:
    def __init__(self, content=b""):
        self.synced = bytearray(content)
        self.pending = []  # (offset, data) since the last sync

    def sync(self):
        for offset, data in self.pending:
            if data is None:
                del self.synced[offset:]
            else:
                put(self.synced, offset, data)
        self.pending = []

    def after_crash(self, draw):
        content = bytearray(self.synced)
        fate = draw.choice(["all", "none", "some"])
        pieces = list(self.pending)
        draw.shuffle(pieces)
        for offset, data in pieces:
            if data is None:  # the file was cut there
                del content[offset if fate != "none" else len(content):]
                continue
            kept = {"all": "whole", "none": "lost"}.get(fate) or draw.choice(["whole", "lost", "torn", "zeros"])
            if kept == "whole":
                put(content, offset, data)
            elif kept == "torn":
                for at in range(0, len(data), SECTOR):
                    if draw.random() < 0.5:
                        put(content, offset + at, data[at:at + SECTOR])
            elif kept == "zeros":  # the length is on the disk, the data is not
                put(content, offset, bytes(len(data)))
        return bytes(content)


def put(content, offset, data):
    if len(content) < offset:
        content.extend(bytes(offset - len(content)))
    content[offset:offset + len(data)] = data


class Disk:
    def __init__(self, target):
        self.synced = {target: File(OLD)}  # names whose directory was synced
        self.names = dict(self.synced)     # names as the running program sees them
        self.pending = []                  # changes of names since then: directory, function of a dictionary

    def change(self, path, names):
        self.pending.append((os.path.dirname(path), names))
        names(self.names)

    def perform(self, call, path, second, offset, data):
        if call == "create":
            file = File()
            self.change(path, lambda names: names.update({path: file}))
        elif call == "rename":
            file = self.names[path]
            self.change(path, lambda names: (names.pop(path, None), names.update({second: file})))
        elif call == "unlink":
            self.change(path, lambda names: names.pop(path, None))
        elif path in self.names:
            file = self.names[path]
            if call == "sync":
                file.sync()
            else:
                file.pending.append((offset, {"cut": None, "hole": bytes(int(second or 0))}.get(call, data)))
        elif call == "sync":  # the sync of a directory makes changes of names in it permanent
            for where, names in self.pending:
                if where == path:
                    names(self.synced)
            self.pending = [change for change in self.pending if change[0] != path]

    def after_crash(self, draw):
        names = dict(self.synced)
        fate = draw.choice(["all", "none", "some"])
        for _, change in self.pending:
            if fate == "all" or (fate == "some" and draw.random() < 0.5):
                change(names)
        return {name: file.after_crash(draw) for name, file in names.items()}


def broken_promise(content, new):
    """Returns true when a superblock is whole and the pages that it commits are not."""
    body = len(new) - SUPERBLOCKS
    whole = any(content[at:at + 4096] == new[at:at + 4096] for at in (body, body + 4096))
    return whole and content[:body] != new[:body]


def replay(place, arguments, tally):
    """Replays a power failure after every call of a run, each with several fates of unsynced data."""
    if not place.target:
        return
    trace = place.home / "trace"
    trace.unlink(missing_ok=True)
    run = place.run(trace=trace)
    calls = read_trace(trace)
    fates = (20 if place.scenario.slow else 300) if arguments.all else (1 if place.scenario.slow else 5)
    disk, target = Disk(str(place.target)), str(place.target)
    states = old = new = 0
    for point in range(len(calls) + 1):
        done = point == len(calls)
        for seed in range(fates):
            draw = random.Random(f"{place.scenario} {point} {seed}")
            left = disk.after_crash(draw)
            states += 1
            old, new = old + (left.get(target) == OLD), new + (left.get(target) == place.new)
            where = f"{place.scenario}: power fails after call {point} of {len(calls)}, fate {seed}"
            if left.get(target) not in (OLD, place.new):
                tally.fail(f"{where}: the target is neither the old file nor the new one")
            if done and left.get(target) != place.new:
                tally.fail(f"{where}: exit {run.code}, but the new file is gone")
            for name, content in left.items():
                if (".o.ptcx.tmp" in name or name.endswith(".resume-pages")) and broken_promise(content, place.new):
                    tally.fail(f"{where}: a superblock is on the disk, what it commits is not")
            if place.scenario.keeps and left.get(target) in (OLD, place.new):
                go_on(place, left, where, tally)
        if not done:
            disk.perform(*calls[point])
    print(f"  {place.scenario}: {len(calls)} calls that change files, {states} states of the disk:"
          f" {old} with the old file, {new} with the new one", flush=True)


def go_on(place, left, where, tally):
    """Checks that a run among the files that a crash left completes the new file."""
    place.reset()
    place.target.unlink()
    for name, content in left.items():
        Path(name).write_bytes(content)
    run = place.run(reset=False)
    for wrong in place.complaints_alone(run, may_leave=True):
        tally.fail(f"{where}: going on: {wrong}")
    if place.target.read_bytes() != place.new:
        tally.fail(f"{where}: going on did not come to the new file: exit {run.code}: {run.errors}")


def judge_killed(place, run, where, tally):
    died = run.code == -signal.SIGKILL
    for wrong in place.complaints(run, may_leave=died):
        if died and wrong.startswith("signal"):
            continue
        tally.fail(f"{place.scenario}: killed {where}: {wrong}")
    return died


def kill(place, arguments, tally):
    """Kills runs with kill -9 before calls on files and at random moments, then runs again among their files."""
    draw = random.Random(str(place.scenario))
    died = points = 0
    if place.preloaded:
        count = place.run(how="kill").calls
        for at in arguments.steps(count, place.most(arguments, 6, 1)):
            points += 1
            died += judge_killed(place, place.run(how="kill", at=at), f"before call {at}", tally)
    began = time.monotonic()
    place.run()
    seconds = time.monotonic() - began
    moments = 100 if arguments.all else place.most(arguments, 6, 1)
    for _ in range(moments):
        moment = draw.uniform(0, 1.1 * seconds)
        process = place.start()
        time.sleep(moment)
        process.kill()
        died += judge_killed(place, place.end(process), f"after {moment:.4f} s", tally)
    again = place.run(reset=False)
    if again.code != 0 or (place.target and place.target.read_bytes() != place.new):
        tally.fail(f"{place.scenario}: after the kills a run ends with {again.code}: {again.errors}")
    print(f"  {place.scenario}: {points} runs to be killed before a call, {moments} at random: {died} died",
          flush=True)
