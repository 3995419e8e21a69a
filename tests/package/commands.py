"""What the tests of this folder share: the build, and running a command that has to succeed.

Environment: PTC_BUILD, a build directory with everything in it; PTC_CMAKE, the program cmake.
"""

import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ["PTC_BUILD"])
CMAKE = pathlib.Path(os.environ["PTC_CMAKE"])


def run(*command, **options):
    """Runs a command to its end. Returns what it prints; raises AssertionError when it fails."""
    done = subprocess.run([str(part) for part in command], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          **options)
    if done.returncode != 0:
        raise AssertionError(f"{command}: {done.returncode}\n{done.stdout}")
    return done.stdout
