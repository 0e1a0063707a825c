"""Laws, runs and predictions of isoflop, for Python.

>>> import isoflop
>>> isoflop.predict(1e18, law="scamo")[0].n_vocab          # doctest: +SKIP
44665.9
>>> results = isoflop.read("results/quickstart")            # doctest: +SKIP
>>> results.runs                                            # a polars or pandas frame
>>> laws = isoflop.fit(frame, columns={"params": "N", "tokens": "D", "loss": "L"}, law="approach3")

Everything is computed by the program ``isoflop``, which is in the wheel; ``ISOFLOP_PROGRAM`` names another.
"""

from ._program import IsoflopError
from ._results import Results, fit, predict, predict_loss, read
from ._types import Interval, Laws, LossPrediction, Minimum, PowerLaw, Prediction, Recommended, Shape

__all__ = [
    "Interval",
    "IsoflopError",
    "Laws",
    "LossPrediction",
    "Minimum",
    "PowerLaw",
    "Prediction",
    "Recommended",
    "Results",
    "Shape",
    "fit",
    "predict",
    "predict_loss",
    "read",
]
