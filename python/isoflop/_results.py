"""``read``, ``fit``, ``predict`` and ``predict_loss``."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from ._program import IsoflopError, ask, made_of, refusing
from ._types import Laws, LossPrediction, Prediction

PathLike = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Results:
    """A sweep's folder: its runs, its laws, its predictions."""

    folder: Path
    #: ``None`` where the runs bear no laws yet.
    laws: Optional[Laws]
    predictions: Tuple[Prediction, ...]

    @property
    def name(self) -> str:
        return self.folder.resolve().name

    @property
    def runs(self) -> Any:
        """A row a finished run: a polars frame, or a pandas one where polars is not installed."""
        return _frame(self.folder / "runs")

    @property
    def scores(self) -> Any:
        """A row a scored run, as ``runs``."""
        return _frame(self.folder / "scores")


def read(results: PathLike) -> Results:
    """A sweep's folder, as ``isoflop run`` leaves it.

    Raises ``IsoflopError`` where it is none.
    """
    with refusing("a sweep's folder is a path"):
        folder = Path(results)
    if not (folder / "runs.csv").exists():
        raise IsoflopError(f"{folder} holds no runs.csv; give a sweep's folder with finished runs", 2)
    laws = _document(folder / "laws.json")
    predictions = _document(folder / "prediction.json") or ()
    return Results(
        folder=folder,
        laws=laws and made_of(Laws._of, laws, folder / "laws.json"),
        predictions=made_of(_predictions, predictions, folder / "prediction.json"),
    )


def _predictions(documents: Any) -> Tuple[Prediction, ...]:
    return tuple(Prediction._of(each) for each in documents)


def fit(
    runs: Any,
    *,
    columns: Optional[Mapping[str, str]] = None,
    law: str = "isoflop",
    where: Sequence[str] = (),
    options: Sequence[str] = (),
) -> Laws:
    """The laws of a table of runs.

    ``runs`` is a polars or pandas frame, a mapping from names to columns, or the path of a table or of a
    sweep's folder. ``columns`` says what its columns mean, as ``{"params": "N", "tokens": "D*1e9"}``; ``law`` is
    ``isoflop``, ``approach1``, ``approach3`` or ``approach3-vocab``; ``options`` are further words of
    ``isoflop fit``.

    Raises ``IsoflopError``; its ``code`` is 3 where the laws are not identifiable.
    """
    words = ["--law", _word(law, "law"), *_words(options, "options")]
    if columns:
        with refusing("columns are a mapping from meanings to columns"):
            words += ["--columns", ",".join(f"{name}={column}" for name, column in columns.items())]
    for condition in _words(where, "where"):
        words += ["--where", condition]
    with _table(runs) as path:
        return made_of(Laws._of, ask(["fit", str(path), *words]), "what isoflop fit printed")


def predict(*budgets: float, law: Union[Laws, PathLike]) -> List[Prediction]:
    """The optimal configuration for each budget in FLOPs.

    ``law`` is ``"scamo"``, laws of ``fit``, or the path of a sweep's folder or of its ``laws.json``.
    """
    if not budgets:
        raise IsoflopError("give a budget in FLOPs", 2)
    asked = [_number(budget, "a budget in FLOPs") for budget in budgets]
    return list(made_of(_predictions, _by(law, asked), "what isoflop predict printed"))


def predict_loss(
    *,
    params: float,
    tokens: float,
    law: Union[Laws, PathLike],
    vocab: Optional[float] = None,
    params_vocab: Optional[float] = None,
) -> LossPrediction:
    """The loss of a model of ``params`` parameters trained on ``tokens``, beside the best model for its FLOPs.

    ``law`` is as in ``predict``, and must know the loss of any N and D: ``approach3``, ``approach3-vocab`` or the
    joint law of a sweep. Where it tells the vocabulary apart, ``params`` is N_nv and ``vocab`` is V;
    ``approach3-vocab`` of a table takes N_v as ``params_vocab``.

    Raises ``IsoflopError`` where the law knows the loss of optimal models only.
    """
    amounts = {"params": params, "tokens": tokens, "vocab": vocab, "params-vocab": params_vocab}
    asked = [f"--{name}={_number(amount, name)}" for name, amount in amounts.items() if amount is not None]
    return made_of(lambda found: LossPrediction._of(found[0]), _by(law, asked), "what isoflop predict printed")


def _number(value: Any, what: str) -> str:
    with refusing(f"{what} is a number"):
        return repr(float(value))


def _word(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise IsoflopError(f"{what} is a text, not {value!r}", 2)
    return value


def _words(values: Union[str, Sequence[str]], what: str) -> List[str]:
    """Texts; one that stands alone is one of them, and not its letters."""
    with refusing(f"{what} are texts"):
        return [_word(value, what) for value in ([values] if isinstance(values, str) else values)]


def _by(law: Union[Laws, PathLike], asked: Sequence[str]) -> Any:
    """What ``isoflop predict`` prints by some law."""
    if not isinstance(law, Laws):
        with refusing("a law is a name, laws of fit, or a path"):
            place = os.fspath(law)
        return ask(["predict", *asked, "--law", place])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "laws.json"
        path.write_text(json.dumps(law.document), encoding="utf-8")
        return ask(["predict", *asked, "--law", str(path)])


def _document(path: Path) -> Any:
    with refusing(f"{path} cannot be read"):
        if not path.exists():
            return None
        # The digest is of the file, and what is read may be written elsewhere.
        return json.loads(path.read_text(encoding="utf-8"), object_hook=_without_digest)


def _without_digest(fields: Any) -> Any:
    if str(fields.get("digest")).startswith("blake3:"):
        del fields["digest"]
    return fields


def _frame(stem: Path) -> Any:
    if not stem.with_suffix(".csv").exists():
        raise IsoflopError(f"{stem}.csv is not there", 2)
    try:
        import polars
    except ImportError:
        pass
    else:
        with refusing(f"{stem}.parquet cannot be read"):
            return polars.read_parquet(stem.with_suffix(".parquet"))
    try:
        import pandas
    except ImportError:
        raise IsoflopError("a frame needs polars or pandas; pip install isoflop[polars]", 2) from None
    with refusing(f"{stem}.csv cannot be read"):
        return pandas.read_csv(stem.with_suffix(".csv"))


@contextmanager
def _table(runs: Any) -> Iterator[Path]:
    """A table as a file, for as long as the block lasts."""
    if isinstance(runs, (str, os.PathLike)):
        yield Path(runs)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "runs.csv"
        with refusing("the runs cannot be written as a table"):
            if hasattr(runs, "write_csv"):
                runs.write_csv(path)
            elif hasattr(runs, "to_csv"):
                runs.to_csv(path, index=False)
            elif isinstance(runs, Mapping):
                _write_csv(path, runs)
            else:
                raise IsoflopError("runs are a frame, a mapping of columns, or a path", 2)
        yield path


def _write_csv(path: Path, columns: Mapping[str, Sequence[Any]]) -> None:
    lengths = {len(column) for column in columns.values()}
    if len(lengths) != 1:
        raise IsoflopError("the columns of a table are of one length", 2)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(_rows(columns))


def _rows(columns: Mapping[str, Sequence[Any]]) -> Iterator[Tuple[Any, ...]]:
    return zip(*columns.values())
