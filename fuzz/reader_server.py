"""Runs spec/reader.py as a server: it reads a path from each line and answers with a line.

The answer is "valid DIGEST", "broken CLAUSE", or "failed TEXT" after any other exception.
"""

import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "spec"))
from reader import Broken  # noqa: E402
from verifier import verify  # noqa: E402


def verdict(path):
    try:
        facts = verify(path)
        return f"valid {facts['content']}" if facts["undecoded_pages"] == 0 else "failed no zstd program"
    except Broken as error:
        return f"broken {error.clause}"
    except Exception as error:  # pylint: disable=broad-except
        return f"failed {type(error).__name__}: {error}".replace("\n", " ")


for line in sys.stdin:
    print(verdict(line.rstrip("\n")), flush=True)
