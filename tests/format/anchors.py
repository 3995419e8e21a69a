"""Checks that every clause that the sources cite exists in the spec; every rule is listed in errors.md and has a
vector; released versions are frozen; what security.md names exists; exit codes are told alike; links of the README, the
guide and the notes lead somewhere.

anchors.py SOURCE_DIR: collects "spec/FILE.md#anchor" and "spec/FILE.md" in sources and documents.
"""

import os
import re
import sys

CITED = re.compile(r"spec/([A-Za-z_]+\.md)(?:#([A-Za-z0-9_-]+))?")
TARGET = re.compile(r"\]\(([^)#:]*)(?:#([^)]+))?\)")
SOURCES = (".h", ".cpp", ".py", ".md", ".txt", ".sh", ".cmake")
FOLDERS = ("format", "engine", "tools", "tests", "fuzz", "spec")


def slug(heading):
    text = re.sub(r"<[^>]*>|[`*]", "", heading)
    return re.sub(r"[^a-z0-9 _-]", "", text.strip().lower()).replace(" ", "-")


def anchors_of(text):
    """Returns headings, explicit anchors, and rules in bold at the start of a list item."""
    found = {slug(m) for m in re.findall(r"^#+ (.*)$", text, re.M)}
    found.update(re.findall(r'<a id="([^"]+)">', text))
    return found


def rules_of(text):
    """Returns the names in bold at the start of list items."""
    return set(re.findall(r"^- (?:<a id=\"[^\"]+\"></a>)?\*\*([a-z0-9-]+)\*\*:", text, re.M))


def sources(root, folders=FOLDERS):
    for folder in folders:
        for directory, _, names in os.walk(os.path.join(root, folder)):
            for name in names:
                if name.endswith(SOURCES):
                    yield os.path.join(directory, name)


def check_vectors(spec, errors):
    """Yields faults: rules without a vector in the folder of their kind, and vectors without a rule."""
    rules = {"bad": set(), "verify": set()}
    without = set()
    for rule, document, when, rest in re.findall(
            r"^\| \[([a-z0-9-]+)\]\(([a-z]+)\.md#[^)]*\) \| ([OPV ]+) \|(.*)$", errors, re.M):
        for kind, letters in (("bad", "OP"), ("verify", "V")):
            if set(letters) & set(when):
                rules[kind].add(f"{document}-{rule}")
        if "no vector: " in rest:
            without.add(f"{document}-{rule}")
    for kind, named in rules.items():
        shown = {name.split(".")[0] for name in os.listdir(os.path.join(spec, "vectors", kind)) if name != "parts"}
        for rule in sorted((named - without) ^ shown):
            yield f"spec/errors.md and vectors/{kind} do not agree on {rule}"
    if len(rules["bad"] | rules["verify"]) < 60:
        yield "spec/errors.md: hardly any rules found: the search is broken"


def check_versions(spec, text):
    """Yields faults: released versions without a list of frozen vectors, and lists without a released version."""
    history = text.split("## How the format may change")[0]
    released = {version for version, body in re.findall(r"^## ([0-9.]+)\n(.*?)(?=^## |\Z)", history, re.M | re.S)
                if "Not released yet" not in body}
    lists = (re.fullmatch(r"frozen-(.+)\.txt", name) for name in os.listdir(os.path.join(spec, "vectors")))
    for version in sorted(released ^ {found[1] for found in lists if found}):
        yield f"spec/versions.md and vectors/frozen-{version}.txt do not agree"


def check_security(root, text):
    """Yields faults: classes that are missing or that nothing covers; vectors, tests and files that do not exist."""
    tests = ""
    for path in sources(os.path.join(root, "tests"), ("",)):
        with open(path, encoding="utf-8") as file:
            tests += file.read()
    for k in range(1, 25):
        row = re.search(rf"^\| A{k} \|.*\|(.*)\|$", text, re.M)
        vectors = re.findall(r"(?<!tests/)\b((?:good|bad|verify)/[a-z][a-z0-9.-]*[a-z0-9])", row[1] if row else "")
        named = re.findall(r'"([a-z ]+: [^"]+)"', row[1] if row else "")
        files = re.findall(r"`([a-z_/]+\.(?:py|cpp))`", row[1] if row else "")
        if not vectors + named + files:
            yield f"spec/security.md: nothing covers A{k}"
        files += [f"spec/vectors/{vector}.ptcx" for vector in vectors]
        for path in files:
            if not os.path.exists(os.path.join(root, path)):
                yield f"spec/security.md: A{k}: there is no {path}"
        for name in named:
            if f'"{name}"' not in tests:
                yield f"spec/security.md: A{k}: there is no test {name}"


def exit_codes(errors):
    """Returns the names of the exit codes in the table of errors.md, by code."""
    section = errors.split("## Exit codes")[1].split("## ")[0]
    return {int(code): name for code, name in re.findall(r"^\| (\d+) \| ([a-z ]+) \|", section, re.M)}


def check_exit_codes(root, documents):
    """Yields faults: exit codes in programs, help, guide or documents that differ from those of errors.md."""
    names = exit_codes(documents["errors.md"])
    if len(names) < 6:
        yield "spec/errors.md: hardly any exit codes found: the search is broken"

    def read(path):
        with open(os.path.join(root, path), encoding="utf-8") as file:
            return file.read()

    header = read("tools/common.h")
    declared = {int(code) for code in re.findall(r"^  k[A-Za-z]+ = (\d+),", header, re.M)}
    for code in sorted(declared ^ set(names)):
        yield f"tools/common.h and spec/errors.md do not agree on exit code {code}"
    guide = "spec/guide/README.md"
    texts = {guide: read(guide).split("Exit codes: ")[1].split("\n\n")[0]}
    common = ""
    for path, name in (("tools/common.h", "kExitCodes"), ("tools/ptcverify.cpp", "kVerifyCodes")):
        literal = read(path).split(f"char {name}[] =")[1].split(";\n")[0]
        # Lines of a program replace those that all programs share.
        common += "".join(re.findall(r'"([^"]*)"', literal)).replace("\\n", " ") + " "
        texts[f"{path}: {name}"] = common
    for where, text in texts.items():
        told = {int(code): name for code, name in re.findall(r"\b(\d),? ([a-z ]+)", " ".join(text.split()))}
        for code in sorted((set(names) - {6}) ^ (set(told) - {6})):
            yield f"{where} and spec/errors.md do not agree on exit code {code}"
        for code, name in told.items():  # a verifier has its own names for 0 and 1
            if code > 1 and names.get(code, name) != name:
                yield f"{where}: exit code {code} is '{name}', in spec/errors.md '{names[code]}'"
    for document, text in documents.items():
        for code, name in re.findall(r"\bexits? (?:with|code) (\d+)(?: \(([^)]*)\))?", text):
            if names.get(int(code)) != name:
                yield f"spec/{document}: exit code {code} without the name '{names.get(int(code))}' in brackets behind it"


def check_links(root):
    """Faults: relative links of documents to files or anchors that are not there.

    Files of spec/results are measured one by one: those that its README lists may be missing.
    """
    with open(os.path.join(root, "spec", "results", "README.md"), encoding="utf-8") as file:
        measured = set(re.findall(r"^\| `([a-z0-9-]+\.md)` \|", file.read(), re.M))
    results = os.path.join(root, "spec", "results", "")
    links = 0
    documents = [path for path in sources(root, ("spec",)) if path.endswith(".md")]
    for path in [os.path.join(root, "README.md"), *sorted(documents)]:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for target, anchor in TARGET.findall(text):
            links += 1
            full = os.path.normpath(os.path.join(os.path.dirname(path), target)) if target else path
            where = f"{os.path.relpath(path, root)}: the link to {target}"
            if not os.path.exists(full):
                if full not in {os.path.normpath(results + name) for name in measured}:
                    yield f"{where} leads nowhere"
            elif anchor and full.endswith(".md"):
                with open(full, encoding="utf-8") as file:
                    if anchor not in anchors_of(file.read()):
                        yield f"{where}#{anchor} leads nowhere"
    if links < 200:
        yield f"only {links} links found: the search is broken"


def main(root):
    spec = os.path.join(root, "spec")
    documents = {}
    for name in os.listdir(spec):
        if name.endswith(".md"):
            with open(os.path.join(spec, name), encoding="utf-8") as file:
                documents[name] = file.read()
    anchors = {name: anchors_of(text) for name, text in documents.items()}
    faults = []

    def check(where, document, anchor):
        if document not in anchors:
            faults.append(f"{where}: spec/{document} does not exist")
        elif anchor.endswith("-"):  # a prefix of anchors
            if not any(a.startswith(anchor) for a in anchors[document]):
                faults.append(f"{where}: spec/{document} has no #{anchor}...")
        elif anchor and anchor not in anchors[document]:
            faults.append(f"{where}: spec/{document} has no #{anchor}")

    cited = 0
    for path in sources(root):
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                for document, anchor in CITED.findall(line):
                    if "FILE" not in document:
                        check(f"{os.path.relpath(path, root)}:{number}", document, anchor)
                        cited += 1
    for name, text in documents.items():
        if name in ("container.md", "points.md", "nodes.md", "parts.md"):
            for rule in rules_of(text):
                check("spec/" + name, name, rule)
                if f"[{rule}]({name}#{rule})" not in documents["errors.md"]:
                    faults.append(f"spec/errors.md does not list {rule} of {name}")
    faults.extend(check_vectors(spec, documents["errors.md"]))
    faults.extend(check_versions(spec, documents["versions.md"]))
    faults.extend(check_exit_codes(root, documents))
    faults.extend(check_security(root, documents["security.md"]))
    faults.extend(check_links(root))
    if cited < 100:
        faults.append(f"only {cited} citations found: the search is broken")
    print("\n".join(faults) if faults else f"{cited} citations exist")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
