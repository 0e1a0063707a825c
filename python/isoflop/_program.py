"""The program ``isoflop`` as a function from words to a JSON document."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sysconfig
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Callable, Iterator, Sequence, TypeVar

Read = TypeVar("Read")


class IsoflopError(Exception):
    """What the program said when it could not do what it was asked.

    ``code`` is its exit code: 2 usage or configuration, 3 the fit is not identifiable.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def program() -> str:
    """The path of the program: ``ISOFLOP_PROGRAM``, that of this environment, or that on the path."""
    named = os.environ.get("ISOFLOP_PROGRAM")
    if named:
        return named
    own = Path(sysconfig.get_path("scripts")) / "isoflop"
    found = str(own) if own.exists() else shutil.which("isoflop")
    if not found:
        raise IsoflopError("the program isoflop is not installed; pip install the wheel", 2)
    return found


@contextmanager
def refusing(what: str) -> Iterator[None]:
    """What Python raises within is an ``IsoflopError`` that begins with ``what``; its cause is kept."""
    try:
        yield
    except IsoflopError:
        raise
    except Exception as error:
        raise IsoflopError(f"{what}: {type(error).__name__}: {error}", 2) from error


def ask(words: Sequence[str]) -> Any:
    """The document that ``isoflop WORDS --json`` prints.

    Raises ``IsoflopError`` where the program ends in an error, cannot be started, or prints something else.
    """
    command = [program(), *words, "--json", "--quiet"]
    with refusing(f"{command[0]} cannot be started"):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    if done.returncode != 0:
        message = done.stderr.decode("utf-8", "replace").strip()
        raise IsoflopError(message.removeprefix("error: ") if message else "isoflop failed", done.returncode)
    with refusing(f"{command[0]} printed no document"):
        return json.loads(done.stdout.decode("utf-8"))


def made_of(read: Callable[[Any], Read], document: Any, place: object) -> Read:
    """``document`` by ``read``, or an error that names its place."""
    with refusing(f"{place} is of another version, or damaged"):
        return read(document)
