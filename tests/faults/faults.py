"""Programs under faults: calls, allocations and threads that fail, crashes, full disks, inputs that change.

faults.py [--all] [--scenario NAME]... PART...; see README.md. Environment: harness.py.
"""

import argparse
import random
import re
import sys
from collections import Counter

import crashes
import surroundings
import tasks
from harness import CALLS, HARMLESS, OLD, Tally, each_scenario

KINDS = {"eio": "Input/output error", "enospc": "No space left on device", "emfile": "Too many open files",
         "eintr": "", "short": "", "none": "Input/output error"}


def steps(count, most):
    """Returns 1 to count, or `most` of these numbers evenly spread, the first and the last included."""
    if count <= most:
        return range(1, count + 1)
    if most == 1:
        return [(1 + count) // 2]
    return sorted({1 + i * (count - 1) // (most - 1) for i in range(most)})


def one_of_each(names, draw):
    """Returns numbers of calls, from 1 on: one call for each name."""
    return sorted(draw.choice([i + 1 for i, n in enumerate(names) if n == name]) for name in sorted(set(names)))


def judge_call(place, run, how, on):
    """Returns the complaints about a run in which the fault `how` hit a call."""
    may_leave = run.call == "unlink" or (on and how == "eio")  # when nothing can be removed
    wrong = place.complaints(run, may_leave)
    if run.code is None or run.code < 0:
        return wrong
    # A file that cannot be opened for direct transfers is opened without them.
    without_o_direct = run.call == "open" and run.path.endswith("/temp") and not on
    if not run.call or not KINDS[how]:
        return wrong + ["not survived"] * (run.code != 0)
    if run.code == 0:
        return wrong + ["the error is swallowed"] * (run.call not in HARMLESS and not without_o_direct)
    if run.code == 2 and "--temp: Directory does not exist" in run.errors:
        return wrong  # CLI11 could not look at the directory
    if run.code != 3 or KINDS[how] not in run.errors or str(place.home) not in run.errors:
        wrong.append("not exit 3 with error and file")
    return wrong


def fail_calls(place, arguments, tally):
    """Lets every call on files fail in every way that it can; errors also continue from then on."""
    told, runs = [], 0
    for how in KINDS:
        clean = place.run(how=how)
        told.append(f"{how} {clean.calls}")
        if arguments.all:
            chosen = arguments.steps(clean.calls, place.most(arguments, 0, 0))
        else:
            chosen = one_of_each(clean.names, random.Random(f"{place.scenario} {how}"))
            chosen = chosen[-1:] if place.scenario.slow else chosen
        for on in (False, True) if how in ("eio", "enospc") else (False,):
            for at in chosen:
                run = place.run(how=how, at=at, on=on, old=OLD if at % 2 else None)
                runs += 1
                for wrong in judge_call(place, run, how, on):
                    tally.fail(f"{place.scenario}: {how} at {at}{' and on' if on else ''} ({run.call} {run.path}):"
                               f" {wrong}; exit {run.code}: {run.errors.strip()[:300]}")
    print(f"  {place.scenario}: {runs} runs; calls by what can happen to them: {', '.join(told)}", flush=True)


def fail_allocations(place, arguments, tally):
    """Lets every allocation fail, once and from then on."""
    count = place.run(how="memory").calls
    codes = Counter()
    for on in (False, True):
        for at in arguments.steps(count, place.most(arguments, 8, 1)):
            run = place.run(how="memory", at=at, on=on)
            codes[run.code] += 1
            wrong = place.complaints(run)
            if run.code not in (0, 3) or (run.code == 3 and "memory" not in run.errors):
                wrong.append("neither done nor exit 3 for want of memory")
            for text in wrong:
                tally.fail(f"{place.scenario}: allocation {at} of {count}{' and on' if on else ''}:"
                           f" {text}; exit {run.code}: {run.errors.strip()[:300]}")
    print(f"  {place.scenario}: {count} allocations; exit codes of {codes.total()} runs: {dict(codes)}", flush=True)


def fail_threads(place, arguments, tally):
    """Lets every start of a thread fail, once and from then on: the result does not change where it can be had."""
    count = place.run(how="thread").calls
    codes = Counter()
    for on in (False, True):
        for at in arguments.steps(count, place.most(arguments, 8, 8)):
            run = place.run(how="thread", at=at, on=on)
            codes[run.code] += 1
            wrong = place.complaints(run)
            if run.code not in (0, 3) or (run.code == 3 and not re.search(r"starting \d+ threads", run.errors)):
                wrong.append("neither done nor exit 3 for want of threads")
            for text in wrong:
                tally.fail(f"{place.scenario}: thread {at} of {count}{' and on' if on else ''}:"
                           f" {text}; exit {run.code}: {run.errors.strip()[:300]}")
    print(f"  {place.scenario}: {count} threads; exit codes of {codes.total()} runs: {dict(codes)}", flush=True)


PARTS = {"calls": fail_calls, "memory": fail_allocations, "threads": fail_threads, "power": crashes.replay, "kill": crashes.kill,
         "disk": surroundings.fill, "change": surroundings.disturb, "farm": tasks.fail_tasks}
PRELOADED = {"calls", "memory", "threads", "power", "change", "farm"}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all when none is given")
    parser.add_argument("--all", action="store_true", help="every call and allocation, not a sample")
    parser.add_argument("--scenario", action="append", default=[])
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - set(PARTS):
        parser.error(f"no such part: {' '.join(unknown)}")
    arguments.steps = steps
    arguments.options = [w for w in sys.argv[1:] if w not in PARTS]
    tally = Tally()
    for part in arguments.parts or PARTS:
        print(f"{part}: {PARTS[part].__doc__.splitlines()[0]}", flush=True)
        if part in PRELOADED and not CALLS:
            print("  skipped: nothing can be preloaded into a program with a sanitizer")
        elif part == "farm":
            tasks.fail_tasks(arguments, tally)
        elif part != "disk" or surroundings.inside_name_space(arguments):
            each_scenario(arguments.scenario, lambda place: PARTS[part](place, arguments, tally))
    tally.end()


if __name__ == "__main__":
    main()
