"""Counts lines of Rust in `src` and `crates`: code, comments and tests apart, without blank lines; and the
files on two ways through them.

    python3 tests/count.py [FOLDER ...]

Tests are files named `tests.rs`, `fixtures.rs` or `testing.rs`, files below a folder `tests`, modules that a
file declares as `#[cfg(test)] mod name;`, and what stands in `#[cfg(test)] mod tests` at the end of a file. A way holds all files that its first ones reach by
imports, tests left out; a name that a module passes on counts for the file that defines it.
"""

import collections
import pathlib
import re
import sys

TEST_FILES = ("tests.rs", "fixtures.rs", "testing.rs")


def is_of_tests(path):
    """Whether a file is compiled for tests alone."""
    above = path.parent / "mod.rs"
    declared = rf"#\[cfg\(test\)\]\n(pub )?mod {path.stem};"
    return (
        path.name in TEST_FILES
        or "tests" in path.parts
        or (above.exists() and re.search(declared, above.read_text(encoding="utf8")) is not None)
    )


def count(path):
    """Lines of one file by what they are."""
    lines = path.read_text(encoding="utf8").split("\n")
    found = collections.Counter(files=1, above_400=len(lines) > 401)
    in_tests = is_of_tests(path)
    found["files_of_tests"] = in_tests
    for line, after in zip(lines, lines[1:] + [""]):
        in_tests |= line == "#[cfg(test)]" and re.match(r"mod \w+ \{", after) is not None
        if line.strip():
            is_comment = line.strip().startswith("//")
            found["tests" if in_tests else "comments" if is_comment else "code"] += 1
    return found


WAYS = {
    "file to plan": ["src/plan/assemble.rs"],
    "records to answer": [f"crates/laws/src/laws/{name}.rs" for name in ("fit/mod", "answer")],
}
CRATES = {"isoflop": "src"} | {
    f"isoflop_{name}": f"crates/{name}/src" for name in ("laws", "spec", "motion", "model")
}
USE = re.compile(r"^ *(pub(?:\([^)]*\))? +)?use +([^;]+);", re.M)
DEFINED = re.compile(r"\b(?:fn|struct|enum|trait|type|const|static|macro_rules!) +(\w+)")
HIDDEN = re.compile(
    r"""//.*|'"'|#\[cfg\(test\)\]\s*(?:pub )?(?:use|mod)[^;{]*;|"(?:\\[\s\S]|[^"\\])*\""""
    r"""|#\[cfg\(test\)\]\nmod tests \{[\s\S]*"""
)


def leaves(text, above=()):
    """The paths of a `use`, each with the name that it gives: `a::{b as c, d}` is a::b, c and a::d, d."""
    parts = re.findall(r"[^,{}]*\{(?:[^{}]|\{(?:[^{}]|\{[^{}]*\})*\})*\}|[^,{}]+", text)
    for part in filter(None, map(str.strip, parts)):
        path, _, within = part.partition("{")
        path, _, name = path.partition(" as ")
        path = (*above, *filter(None, map(str.strip, path.split("::"))))
        if within:
            yield from leaves(within[:-1], path)
        else:
            path = path[:-1] if path[-1] == "self" else path
            yield path, name.strip() or path[-1]


class Tree:
    """The modules of all crates, by crate and path: file, names passed in and on, names defined, text."""

    def __init__(self):
        self.modules = {}
        for crate, root in CRATES.items():
            for path in pathlib.Path(root).rglob("*.rs"):
                parts = path.relative_to(root).with_suffix("").parts
                module = parts[:-1] if parts[-1] in ("mod", "lib") else parts
                text = HIDDEN.sub("", path.read_text(encoding="utf8"))
                uses = [(*use, bool(m[1])) for m in USE.finditer(text) for use in leaves(m[2])]
                body = USE.sub("", text)
                defined = set(DEFINED.findall(body))
                self.modules[crate, *module] = (str(path), uses, defined, body)

    def find(self, at, path, steps=12):
        """The module that defines what a path names, and the name; no name where it is a module itself."""
        first, *rest = path
        if first == "crate" or first in CRATES:
            at = (at[0] if first == "crate" else first,)
        elif first == "super":
            at = at[:-1]
        elif first != "self":
            rest = list(path)
        for n, name in enumerate(rest):
            _, uses, defined, body = self.modules.get(at, ("", [], set(), ""))
            if name == "super":
                at = at[:-1]
            elif (*at, name) in self.modules:
                at = (*at, name)
            elif name in defined or not steps:
                return at, name
            else:
                named = [use for use, own, _ in uses if own == name and use != (name,)]
                globs = [(*use[:-1], name) for use, own, public in uses if own == "*" and public]
                found = (self.find(at, (*way, *rest[n + 1 :]), steps - 1) for way in named + globs)
                known = not named and re.search(rf"\b{name}\b", body)
                return next((one for one in found if one[0]), (at if known else None, name))
        return at, None

    def needs(self, at):
        """The modules whose names a module uses."""
        _, uses, _, body = self.modules[at]
        words = set(re.findall(r"\w+", body))
        for path, name, _ in uses:
            if name == "*":
                yield from (self.find(at, (*path[:-1], word)) for word in words if path[:-1])
            elif name in words:
                found = self.find(at, path)
                inner = re.findall(rf"(?<![:\w]){name}::(\w+)", body) if found[1] is None else []
                yield from (self.find(found[0], ("self", word)) for word in inner)
                yield found
        for path in re.findall(r"(?<![:\w])[a-z_]\w*(?:::\w+)+", body):
            first, *_ = path = path.split("::")
            if first in ("crate", "super", "self", *CRATES) or (*at, first) in self.modules:
                yield self.find(at, path)

    def reached(self, files):
        """All files that the first ones need."""
        todo = [at for at, (path, *_) in self.modules.items() if path in files]
        seen = set()
        while todo:
            at = todo.pop()
            if at in self.modules and at not in seen:
                seen.add(at)
                todo.extend(need for need, name in self.needs(at) if name)
        return {self.modules[at][0] for at in seen}


def main():
    total = collections.Counter()
    for folder in sys.argv[1:] or ["src", "crates"]:
        rooms = collections.defaultdict(collections.Counter)
        for path in sorted(pathlib.Path(folder).rglob("*.rs")):
            room = path.relative_to(folder).parts[:-1]
            rooms["/".join([folder, *room[:3 if folder == "crates" else 1]])] += count(path)
        for room, found in rooms.items():
            print(f"{room:<28}", *(f"{name} {found[name]:>6}" for name in found))
            total += found
    print(f"{'all':<28}", *(f"{name} {total[name]:>6}" for name in total))
    if not sys.argv[1:]:
        tree = Tree()
        print(", ".join(f"{way}: {len(tree.reached(files))} files" for way, files in WAYS.items()))


if __name__ == "__main__":
    main()
