"""Counts lines of Rust in `src` and `crates`: code, comments and tests apart, without blank lines.

    python3 tests/count.py [FOLDER ...]

Tests are files named `tests.rs`, `fixtures.rs` or `testing.rs`, files below a folder `tests`, and what
stands in `#[cfg(test)] mod tests` at the end of a file.
"""

import collections
import pathlib
import re
import sys

TEST_FILES = ("tests.rs", "fixtures.rs", "testing.rs")


def count(path):
    """Lines of one file by what they are."""
    lines = path.read_text(encoding="utf8").split("\n")
    found = collections.Counter(files=1, above_400=len(lines) > 401)
    in_tests = path.name in TEST_FILES or "tests" in path.parts
    found["files_of_tests"] = in_tests
    for line, after in zip(lines, lines[1:] + [""]):
        in_tests |= line == "#[cfg(test)]" and re.match(r"mod \w+ \{", after) is not None
        if line.strip():
            is_comment = line.strip().startswith("//")
            found["tests" if in_tests else "comments" if is_comment else "code"] += 1
    return found


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


if __name__ == "__main__":
    main()
