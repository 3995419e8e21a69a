"""The second reader on the vectors and on damaged files.

vectors_test.py SOURCE_DIR TEMP_DIR: good files are valid and hold what good.txt says, every other one
is refused by the rule in its name, a scene of parts has the points and the tree of the same scene in one file, the
vectors are what spec/vectors.py writes and what was frozen, and no flipped bit of three small files goes unseen.
"""

import hashlib
import os
import re
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
             "nodes-node-greatest", "nodes-node-emission", "nodes-node-cone"}
# Folders of vectors, and those of the parts that scenes among them name.
FOLDERS = ("good", "good/parts", "bad", "bad/parts", "verify", "verify/parts")
# Parts that are damaged themselves, with the rule that they break.
BROKEN_PARTS = {"damaged.ptcx": "container-page-payload", "padded.ptcx": "container-padding"}
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
    """Compares what the reader finds with good.txt."""
    with open(os.path.join(SPEC, "vectors", "good.txt"), encoding="utf-8") as file:
        expected = set(file)
    good = os.path.join(SPEC, "vectors", "good")
    found = {found_in(good, name) for name in files(good)}
    faults.extend(f"good.txt: {line}" for line in expected ^ found)


def check_frozen():
    """Compares every vector with the hash by which a released version froze it."""
    root = os.path.join(SPEC, "vectors")
    hashes = {}
    for name in sorted(os.listdir(root)):
        if not re.fullmatch(r"frozen-\d+\.\d+\.txt", name):
            continue
        with open(os.path.join(root, name), encoding="utf-8") as file:
            for line in file:
                wanted, path = line.rstrip("\n").split("  ")
                if path in hashes:
                    faults.append(f"{name}: {path} is frozen twice")
                hashes[path] = wanted
    there = {f"{folder}/{name}" for folder in FOLDERS for name in files(os.path.join(root, folder))} | {"xxh3.txt"}
    faults.extend(f"{path} is not frozen" for path in sorted(there - set(hashes)))
    faults.extend(f"{path} is frozen, and gone" for path in sorted(set(hashes) - there))
    for path in sorted(there & set(hashes)):
        with open(os.path.join(root, path), "rb") as file:
            if hashlib.sha256(file.read()).hexdigest() != hashes[path]:
                faults.append(f"{path} is not what was frozen")


def check_verdicts():
    count = 0
    for kind in FOLDERS:
        folder = os.path.join(SPEC, "vectors", kind)
        for name in files(folder):
            rule = name.split(".")[0]
            expected = "valid" if kind == "good" or rule in UNCHECKED else rule
            if kind.endswith("parts"):
                expected = BROKEN_PARTS.get(name, "valid")
            found = verdict(os.path.join(folder, name))
            if found != expected:
                faults.append(f"{kind}/{name}: {found}")
            count += 1
    return count


def tree(container):
    """Returns cell, level and summaries of every group and the runs of leaves, children before their parents."""
    out, s = [], container.superblock
    path = [(s.root_page, s.root_slot, False)]
    while path:
        page, slot, is_open = path.pop()
        groups, payload = container.groups(page)
        group = groups[slot]
        if is_open:
            runs = [(child.first, child.count) for child in group.children]
            sums = [reader.summary(payload, group, i) for i in range(len(runs))]
            out.append((group.cell, group.level, runs, sums))
            continue
        if len(out) + len(path) > 8 * s.node_groups:
            return [f"{container.path}: the walk does not end"]
        path.append((page, slot, True))
        path.extend((c.page, c.slot, False) for c in reversed(group.children) if c.interior)
    return out


def points(container):
    """Returns every column of all points."""
    rows = []
    for page in container.points():
        light = (*page.radiance, *page.albedo, *page.emission)
        rows.extend(zip(page.keys, page.radius, page.normal, *light))
    return rows


def check_parts(scene, one):
    """Compares a scene of parts with the same scene in one file, to the last bit."""
    containers = [reader.open_container(os.path.join(SPEC, "vectors", "good", name)) for name in (scene, one)]
    for what in (points, tree):
        found = [what(container) for container in containers]
        if found[0] != found[1] or not found[0]:
            faults.append(f"good/{scene} and good/{one} differ in their {what.__name__}")
    for container in containers:
        container.close()


def check_refused_when_loaded():
    """Opening a bad file and loading all its pages is enough to find its fault."""
    folder = os.path.join(SPEC, "vectors", "bad")
    for name in files(folder):
        found = "valid"
        try:
            container = reader.open_container(os.path.join(folder, name))
            container.load(range(container.superblock.page_count))
            points(container)
            for rank in range(container.all_node_pages):
                container.groups(rank)
        except reader.Broken as error:
            found = "-".join(error.clause.removeprefix("spec/").split(".md#"))
        if found != name.split(".")[0]:
            faults.append(f"bad/{name}: loading it says {found}")


def check_broken_part():
    """A part that is broken or missing is named by its own path."""
    for name, part in (("container-page-payload.of-a-part", "damaged"), ("parts-parts-file", "missing")):
        folder = os.path.join(SPEC, "vectors", "bad")
        try:
            verifier.verify(os.path.join(folder, name + ".ptcx"))
        except reader.Broken as error:
            if error.file != os.path.join(folder, "parts", part + ".ptcx"):
                faults.append(f"bad/{name}.ptcx: the error names {error.file}")


def check_file_by_hand():
    """Compares the bytes that overview.md shows with those of the file that it speaks of. @return the number of lines"""
    with open(os.path.join(SPEC, "overview.md"), encoding="utf-8") as file:
        section = file.read().split("## A file by hand")[1]
    with open(os.path.join(SPEC, "vectors", "good", "one-point.ptcx"), "rb") as file:
        data = file.read()
    lines = re.findall(r"^ *(\d+)  ((?:[0-9a-f]{2} )*[0-9a-f]{2})  +\S", section, re.MULTILINE)
    for at, shown in lines:
        expected = bytes.fromhex(shown)
        if data[int(at):int(at) + len(expected)] != expected:
            faults.append(f"overview.md: the bytes at {at} are not those of one-point.ptcx")
    return len(lines)


def check_written_again():
    """Writes the vectors again. Compressed pages depend on the version of zstd, so zstd.ptcx is not compared here."""
    shutil.rmtree(TEMP, ignore_errors=True)
    vectors.write_all(TEMP)
    for kind in FOLDERS:
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
    path = os.path.join(TEMP, "good", "flipped.ptcx")  # next to the folder of parts
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
check_frozen()
if check_file_by_hand() < 80:
    faults.append("overview.md: the file by hand has lost lines")
check_parts("two-parts.ptcx", "two-parts-as-one-file.ptcx")
check_broken_part()
check_refused_when_loaded()
check_written_again()
check_without_zstd()
bits = sum(map(check_flipped_bits, ("one-point.ptcx", "zstd-frame-by-hand.ptcx", "one-part.ptcx")))
print("\n".join(faults) if faults else f"{checked} verdicts right, {bits} flipped bits found")
sys.exit(1 if faults or checked < 100 or bits < 1000 else 0)
