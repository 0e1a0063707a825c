"""The program ``isoflop`` as a function from words to a JSON document."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Any, Sequence


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


def ask(words: Sequence[str]) -> Any:
    """The document that ``isoflop WORDS --json`` prints.

    Raises ``IsoflopError`` where the program ends in an error.
    """
    done = subprocess.run(
        [program(), *words, "--json", "--quiet"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        check=False,
    )
    if done.returncode != 0:
        message = done.stderr.strip()
        raise IsoflopError(message.removeprefix("error: ") if message else "isoflop failed", done.returncode)
    return json.loads(done.stdout)
