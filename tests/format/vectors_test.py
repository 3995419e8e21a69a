"""The second reader on the vectors and on damaged files.

vectors_test.py SOURCE_DIR TEMP_DIR: good files are valid and hold what good.txt says, every other one
is refused by the rule in its name, the vectors are what spec/vectors.py writes, and no flipped bit of two small files goes
unseen.
"""

import os
import shutil
import sys

SOURCE, TEMP = sys.argv[1], sys.argv[2]
SPEC = os.path.join(SOURCE, "spec")
sys.dont_write_bytecode = True
sys.path.insert(0, SPEC)
import reader  # noqa: E402
import vectors  # noqa: E402
import verifier  # noqa: E402

# Rules about the values of summaries, which reader.py does not recompute.
UNCHECKED = {"nodes-node-mean", "nodes-node-sphere", "nodes-node-slab", "nodes-node-sums",
             "nodes-node-cone"}
faults = []


def verdict(path):
    try:
        verifier.verify(path)
        return "valid"
    except reader.Broken as error:
        document, anchor = error.clause.removeprefix("spec/").split(".md#")
        return f"{document}-{anchor}"


def files(folder):
    return sorted(n for n in os.listdir(folder) if n.endswith(".ptcx"))


def found_in(folder, name):
    """Returns the line of good.txt for what the reader finds."""
    path = os.path.join(folder, name)
    facts = verifier.verify(path)
    container = reader.open_container(path)
    pages = container.load(range(facts["pages"]))
    container.close()
    payloads = reader.xxh3_64(b"".join(bytes(pages[i]) for i in range(facts["pages"])))
    return (f"{name[:-5]} {facts['points']} {facts['nodes']} {facts['groups']} {facts['levels']} "
            f"{facts['pages']} {facts['content']} {payloads:016x}\n")


def check_content():
    """Compares what the reader finds with good.txt, for the current vectors and those of each released version."""
    root = os.path.join(SPEC, "vectors")
    frozen = os.path.join(root, "frozen")
    for folder in [root, *(e.path for e in os.scandir(frozen))] if os.path.exists(frozen) else [root]:
        with open(os.path.join(folder, "good.txt"), encoding="utf-8") as file:
            expected = set(file)
        good = os.path.join(folder, "good")
        found = {found_in(good, name) for name in files(good)}
        faults.extend(f"{folder}/good.txt: {line}" for line in expected ^ found)


def check_verdicts():
    count = 0
    for kind in ("good", "bad", "verify"):
        folder = os.path.join(SPEC, "vectors", kind)
        for name in files(folder):
            rule = name.split(".")[0]
            expected = "valid" if kind == "good" or rule in UNCHECKED else rule
            found = verdict(os.path.join(folder, name))
            if found != expected:
                faults.append(f"{kind}/{name}: {found}")
            count += 1
    return count


def check_written_again():
    """Writes the vectors again. Compressed pages depend on the version of zstd, so zstd.ptcx is not compared here."""
    shutil.rmtree(TEMP, ignore_errors=True)
    vectors.write_all(TEMP)
    for kind in ("good", "bad", "verify"):
        old, new = (os.path.join(d, kind) for d in (os.path.join(SPEC, "vectors"), TEMP))
        missing = set(files(old)) ^ set(files(new))
        if missing - {"zstd.ptcx"}:
            faults.append(f"{kind}: {sorted(missing)} are not on both sides")
        for name in set(files(old)) & set(files(new)) - {"zstd.ptcx"}:
            with open(os.path.join(old, name), "rb") as a, open(os.path.join(new, name), "rb") as b:
                if a.read() != b.read():
                    faults.append(f"{kind}/{name} is not what spec/vectors.py writes")


def check_flipped_bits(name):
    """Flips one bit of every byte that is not zero, and of one byte in each 64 that are."""
    with open(os.path.join(SPEC, "vectors", "good", name), "rb") as file:
        whole = file.read()
    path = os.path.join(TEMP, "flipped.ptcx")
    flipped = 0
    for at in range(len(whole)):
        if whole[at] == 0 and at % 64 != 63:
            continue
        changed = bytearray(whole)
        changed[at] ^= 1 << at % 8
        with open(path, "wb") as file:
            file.write(changed)
        if verdict(path) == "valid":
            faults.append(f"{name}: a flipped bit of byte {at} went unseen")
        flipped += 1
    for length in range(0, len(whole), 1021):
        with open(path, "wb") as file:
            file.write(whole[:length])
        if verdict(path) == "valid":
            faults.append(f"{name}: truncation to {length} bytes went unseen")
    return flipped


def check_without_zstd():
    """Without zstd only the checksums of compressed pages are verified, and the verdict says so."""
    which, reader.shutil.which = reader.shutil.which, lambda name: None
    try:
        facts = verifier.verify(os.path.join(SPEC, "vectors", "good", "zstd.ptcx"))
        if facts["undecoded_pages"] == 0:
            faults.append("zstd.ptcx: no page was left undecoded without zstd")
    finally:
        reader.shutil.which = which


os.makedirs(TEMP, exist_ok=True)
checked = check_verdicts()
check_content()
check_written_again()
check_without_zstd()
bits = check_flipped_bits("one-point.ptcx") + check_flipped_bits("zstd-frame-by-hand.ptcx")
print("\n".join(faults) if faults else f"{checked} verdicts right, {bits} flipped bits found")
sys.exit(1 if faults or checked < 100 or bits < 1000 else 0)
