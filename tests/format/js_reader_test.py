"""The reader in JavaScript on the vectors, and what it finds next to what the second reader finds.

js_reader_test.py SOURCE_DIR TEMP_DIR: every good file is accepted and every other one is refused by the rule in its name,
XXH3 agrees with its table, and counts, channels, texts, bounds, points and sums of nodes of the good files are those that
spec/reader.py reads, to the last bit. The packages of spec/js are installed below TEMP_DIR. Where node, npm or its registry
are not to be had, the test is skipped: it says why and exits with 77.
"""

import json
import os
import re
import shutil
import struct
import subprocess
import sys

SOURCE, TEMP = map(os.path.abspath, sys.argv[1:3])
SPEC = os.path.join(SOURCE, "spec")
VECTORS = os.path.join(SPEC, "vectors")
SKIPPED = 77
sys.dont_write_bytecode = True
sys.path.insert(0, SPEC)
import reader  # noqa: E402

# Rules, and vectors of rules, that bind what a partial reader leaves out or has not read (spec/README.md#conformance).
LEFT_OUT = {"container-header-checksum", "container-header-magic", "container-header-zero.rest",
            "container-directory-pages", "container-page-codec.directory", "container-page-length.void-with-hash",
            "container-page-length.void-with-offset", "container-superblock-counts.groups",
            "container-superblock-counts.of-parts", "container-superblock-digest"}
faults = []


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(SKIPPED)


def installed():
    """Returns the folder with a copy of the reader and its packages, which npm installs when its lock changed."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if not node or not npm:
        skip("node or npm is not installed")
    version = subprocess.run([node, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    if int(re.match(r"v(\d+)", version)[1]) < 18:
        skip(f"node {version} is older than 18")
    folder = os.path.join(TEMP, "js")
    os.makedirs(folder, exist_ok=True)
    lock = os.path.join(folder, "package-lock.json")
    with open(os.path.join(SPEC, "js", "package-lock.json"), "rb") as file:
        wanted = file.read()
    stamp = os.path.join(folder, "node_modules", "installed")
    for name in os.listdir(os.path.join(SPEC, "js")):
        if name.endswith((".js", ".json")):
            shutil.copy(os.path.join(SPEC, "js", name), folder)
    if os.path.exists(stamp):
        with open(stamp, "rb") as file:
            if file.read() == wanted:
                return folder
    install(npm, folder)
    shutil.copy(lock, stamp)
    return folder


def install(npm, folder):
    """Installs the packages of the lock; the test is skipped where the registry does not answer."""
    command = [npm, "ci", "--no-audit", "--no-fund", "--ignore-scripts", "--fetch-retries=0", "--fetch-timeout=20000"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=50)
    except subprocess.TimeoutExpired:
        skip("npm's registry does not answer")
    if done.returncode != 0:
        if re.search(r"\b(E[45]\d\d|ENOTFOUND|EAI_AGAIN|ECONN\w+|ENET\w+|EHOST\w+|ETIMEDOUT|ERR_SOCKET_TIMEOUT)\b",
                     done.stderr):
            skip("npm's registry cannot be reached")
        sys.exit(f"npm ci failed:\n{done.stderr}")


def files():
    return [(kind, name) for kind in ("good", "bad", "verify")
            for name in sorted(os.listdir(os.path.join(VECTORS, kind))) if name.endswith(".ptcx")]


def verdicts(folder):
    """Returns what the reader says of every vector, by kind and name; one process judges them all."""
    names = "".join(os.path.join(VECTORS, *file) + "\n" for file in files())
    done = subprocess.run(["node", "cli.js", "batch"], cwd=folder, input=names, capture_output=True, text=True,
                          timeout=120)
    if done.returncode != 0:
        sys.exit(f"the reader failed: {done.stderr}")
    lines = [json.loads(line) for line in done.stdout.split("\n") if line]
    return {tuple(line["path"].split("/")[-2:]): line for line in lines}


def rule_of(refused):
    """Returns a refusal's rule as names of vectors write it."""
    return "-".join(refused["rule"].removeprefix("spec/").split(".md#")) if refused else "valid"


def check_verdict(kind, name, found):
    """Compares verifier, full reader and partial reader with the kind and the name of a vector."""
    rule = name.removesuffix(".ptcx").split(".")[0]
    expected = "valid" if kind == "good" else rule
    verified = rule_of(found["verify"])
    if verified != expected:
        faults.append(f"{kind}/{name}: the verifier says {verified}: {found['verify']}")
    if found["verify"] and not isinstance(found["verify"]["offset"], int):
        faults.append(f"{kind}/{name}: the verifier names no offset")
    loaded = rule_of(found["dump"].get("refused"))
    if loaded != (rule if kind == "bad" else "valid"):
        faults.append(f"{kind}/{name}: the reader says {loaded}")
    partial = rule_of(found["partial"])
    if kind == "good" and partial != "valid":
        faults.append(f"{kind}/{name}: the partial reader says {partial}")
    if kind == "bad" and partial == "valid" and not {rule, name.removesuffix(".ptcx")} & LEFT_OUT:
        faults.append(f"{kind}/{name}: the partial reader accepts it")


def octahedral(u, v):
    """Returns the unit vector of spec/README.md#types, in float64."""
    q = 32767
    a, b = max(u, -q), max(v, -q)
    c = q - abs(a) - abs(b)
    if c < 0:
        a, b = (q - abs(b)) * (-1 if a < 0 else 1), (q - abs(a)) * (-1 if b < 0 else 1)
    length = (a * a + b * b + c * c) ** 0.5
    return a / length, b / length, c / length


def rgbe(bits):
    return [(bits >> shift & 255) * 2.0 ** ((bits >> 24) - 136) for shift in (0, 8, 16)]


def hash_of(kind, values):
    values = list(values)
    return f"{reader.xxh3_64(struct.pack(f'<{len(values)}{kind}', *values)):016x}"


def node_sums(container):
    """Returns area, facing and radiance of all nodes, page by page and slot by slot."""
    values = []
    for rank in range(container.all_node_pages):
        groups, payload = container.groups(rank)
        for group in groups:
            for i in range(len(group.children)):
                stored = reader.summary(payload, group, i)
                values += struct.unpack("<f", struct.pack("<I", stored["area"] << 15))
                values += [code / 65535 for code in stored["facing"]]
                values += [part for bits in stored["radiance"] for part in rgbe(bits)]
    return values


def expected_dump(path, row):
    """Returns what the second reader and a row of good.txt say of a good file, under the names of the dump."""
    container = reader.open_container(path)
    s, header = container.superblock, container.header
    pages = list(container.points())
    origin, unit = header.origin, header.edge / 2.0 ** 42
    facts = {
        "points": s.points, "nodes": s.nodes, "groups": s.node_groups, "levels": s.levels, "pages": s.page_count,
        "leafPoints": s.leaf_points, "pointBytes": header.point_bytes, "pageSize": 1 << header.page_shift,
        "boundsLow": list(s.bounds_low), "boundsHigh": list(s.bounds_high), "area": s.area, "flux": list(s.flux),
        "origin": list(origin), "edge": header.edge, "digest": row[5], "texts": container.meta.text,
        "channels": [channel.name for channel in container.meta.channels],
        "hashes": {
            "payloads": row[6],
            "positions": hash_of("d", (origin[k] + q * unit for p in pages for place in zip(p.x, p.y, p.z)
                                       for k, q in enumerate(place))),
            "normals": hash_of("d", (part for p in pages for uv in p.normal for part in octahedral(*uv))),
            "radii": hash_of("f", (radius for p in pages for radius in p.radius)),
            "albedo": hash_of("B", (part for p in pages for colour in zip(*p.albedo) for part in colour)),
            "radiance": hash_of("f", (part for p in pages for colour in zip(*p.radiance) for part in colour)),
            "emission": hash_of("f", (part for p in pages for colour in zip(*(p.emission or ())) for part in colour)),
            "nodeSums": hash_of("d", node_sums(container)),
        },
    }
    container.close()
    return facts


def check_dumps(found):
    """Compares the dump of every good file with what the second reader reads, field by field."""
    with open(os.path.join(VECTORS, "good.txt"), encoding="utf-8") as file:
        rows = {name: numbers for name, *numbers in map(str.split, file)}
    for name, row in rows.items():
        path = os.path.join(VECTORS, "good", f"{name}.ptcx")
        if name.startswith("zstd") and not shutil.which("zstd"):
            continue
        dump = found["good", f"{name}.ptcx"]["dump"]["value"]
        dump["channels"] = [channel["name"] for channel in dump["channels"]]
        for key, value in expected_dump(path, row).items():
            if key == "hashes":
                faults.extend(f"good/{name}.ptcx: hash of {part}: {dump[key][part]} and not {hash_}"
                              for part, hash_ in value.items() if dump[key][part] != hash_)
            elif dump[key] != value:
                faults.append(f"good/{name}.ptcx: {key}: {dump[key]} and not {value}")
    return len(rows)


def check_exit_codes(folder):
    """Runs the program as a person does: 0 for a valid file, 1 for a broken one, 2 for wrong usage, 3 for no file."""
    good, bad = (os.path.join(VECTORS, name) for name in ("good/one-point.ptcx", "bad/container-page-keys.ptcx"))
    for code, arguments in ((0, ["verify", good, "--level", "2"]), (1, ["verify", bad]), (1, ["dump", bad]),
                            (2, []), (2, ["verify", good, "--level", "4"]), (3, ["dump", os.path.join(TEMP, "none")]),
                            (0, ["xxh3", os.path.join(VECTORS, "xxh3.txt")])):
        done = subprocess.run(["node", "cli.js", *arguments], cwd=folder, capture_output=True, text=True, timeout=60)
        if done.returncode != code:
            faults.append(f"{arguments} exits with {done.returncode} and not {code}: {done.stderr}")


folder = installed()
found = verdicts(folder)
for file in files():
    check_verdict(*file, found[file])
dumps = check_dumps(found)
check_exit_codes(folder)
print("\n".join(faults) if faults else f"{len(found)} verdicts and {dumps} dumps right")
sys.exit(1 if faults or len(found) < 250 or dumps < 40 else 0)
