"""The one place that tells generators apart."""

from .autoregressive import NextCode
from .masked import masked
from .scalewise import NextScale
from .store import Captions, Codes


def objective(spec):
    """What a run learns: its model, its batches, its loss."""
    kind = spec.generator["kind"]
    codes, captions = Codes(spec.codes, spec.grid), Captions(spec.text)
    kinds = {"autoregressive": NextCode, "masked": masked, "scalewise": NextScale}
    if kind not in kinds:
        raise SystemExit(f"the torch trainer does not know the generator `{kind}`")
    return kinds[kind](spec, codes, captions)
