"""What laws and predictions say, as values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Tuple

#: Lower and upper end of a 95 % interval.
Interval = Tuple[float, float]


def _interval(value: Any) -> Optional[Interval]:
    return None if value is None else (float(value[0]), float(value[1]))


def _intervals(document: Mapping[str, Any]) -> "dict[str, Optional[Interval]]":
    return {name: _interval(value) for name, value in document.items()}


#: The names of a prediction's intervals; the program leaves out what is not known.
_INTERVALS = ("params", "params_nonvocab", "params_vocab", "n_vocab", "tokens", "loss_normalised")


@dataclass(frozen=True)
class PowerLaw:
    """``y = 10**log10_coefficient * C**exponent``."""

    exponent: float
    log10_coefficient: float
    r2: float
    #: Minima that it was fitted to.
    n: int
    exponent_ci95: Optional[Interval]

    def __call__(self, compute: float) -> float:
        return float(10.0**self.log10_coefficient * compute**self.exponent)

    @staticmethod
    def _of(document: Optional[Mapping[str, Any]]) -> Optional["PowerLaw"]:
        if document is None:
            return None
        return PowerLaw(
            exponent=document["exponent"],
            log10_coefficient=document["log10_coefficient"],
            r2=document["r2"],
            n=document["n"],
            exponent_ci95=_interval(document.get("exponent_ci95")),
        )


@dataclass(frozen=True)
class Minimum:
    """The best configuration of a budget by one method, and what is doubtful about it."""

    method: str
    budget_flops: float
    params_nonvocab: float
    params_vocab: float
    n_vocab: float
    tokens: float
    loss: float
    trusted: bool
    flags: Tuple[str, ...]

    @staticmethod
    def _of(document: Mapping[str, Any]) -> "Minimum":
        return Minimum(
            method=document["method"],
            budget_flops=document["budget_flops"],
            params_nonvocab=document["params_nonvocab"],
            params_vocab=document["params_vocab"],
            n_vocab=document["n_vocab"],
            tokens=document["tokens"],
            loss=document["loss_normalised"],
            trusted=document.get("trusted", False),
            flags=tuple(document.get("flags", ())),
        )


@dataclass(frozen=True)
class Recommended:
    """The law that predicts best, and why."""

    law: str
    why: str


@dataclass(frozen=True)
class Laws:
    """The laws of a sweep or of a table."""

    name: str
    law: str
    flops_rule: str
    recommended: Optional[Recommended]
    #: What the fit says: ``formula``, ``coefficients``, ``exponents`` of the optimum by the recommended law,
    #: ``held_out``, ``verdict`` and ``doubts``, as the program prints them.
    answer: Mapping[str, Any]
    #: Through the minima, by ``params_nonvocab``, ``params_vocab``, ``tokens``, or ``params`` where N is not told apart.
    power_laws: Mapping[str, PowerLaw]
    vocab_from_nonvocab: Optional[PowerLaw]
    minima: Tuple[Minimum, ...]
    #: The parametric loss of ``approach3`` and ``approach3-vocab``, as the program prints it.
    parametric: Optional[Mapping[str, Any]]
    warnings: Tuple[str, ...]
    #: All that the program printed.
    document: Mapping[str, Any] = field(repr=False)

    @staticmethod
    def _of(document: Mapping[str, Any]) -> "Laws":
        powers = {name: PowerLaw._of(law) for name, law in document["power_laws"].items()}
        recommended = document.get("recommended")
        return Laws(
            name=document["name"],
            law=document["law"],
            flops_rule=document["flops_rule"],
            recommended=recommended and Recommended(law=recommended["law"], why=recommended["why"]),
            answer=document.get("answer") or {},
            power_laws={name: law for name, law in powers.items() if law is not None},
            vocab_from_nonvocab=PowerLaw._of(document.get("vocab_from_nonvocab")),
            minima=tuple(Minimum._of(minimum) for minimum in document["minima"]),
            parametric=document.get("parametric"),
            warnings=tuple(document["warnings"]),
            document=document,
        )


@dataclass(frozen=True)
class Shape:
    """The nearest model that can be built. ``levels`` are those of FSQ."""

    n_layer: int
    n_head: int
    d_model: int
    n_vocab: int
    levels: Tuple[int, ...]


@dataclass(frozen=True)
class Prediction:
    """The optimal configuration for a budget."""

    budget_flops: float
    law: str
    #: The law that gave the loss.
    recommended: Optional[str]
    #: N, where N_nv and N_v are not told apart; then those are ``None``.
    params: Optional[float]
    params_nonvocab: Optional[float]
    params_vocab: Optional[float]
    n_vocab: Optional[float]
    tokens: float
    loss: Optional[float]
    #: By the names of the quantities; ``None`` where there is no interval.
    ci95: Mapping[str, Optional[Interval]]
    #: The budget over the largest one fitted.
    extrapolation_factor: float
    shape: Optional[Shape]
    warnings: Tuple[str, ...]
    document: Mapping[str, Any] = field(repr=False)

    @staticmethod
    def _of(document: Mapping[str, Any]) -> "Prediction":
        shape = document.get("shape")
        return Prediction(
            budget_flops=document["budget_flops"],
            law=document["law"],
            recommended=document.get("recommended"),
            params=document.get("params"),
            params_nonvocab=document.get("params_nonvocab"),
            params_vocab=document.get("params_vocab"),
            n_vocab=document.get("n_vocab"),
            tokens=document["tokens"],
            loss=document.get("loss_normalised"),
            ci95={**dict.fromkeys(_INTERVALS), **_intervals(document.get("ci95") or {})},
            extrapolation_factor=document["extrapolation_factor"],
            shape=shape
            and Shape(
                n_layer=shape["n_layer"],
                n_head=shape["n_head"],
                d_model=shape["d_model"],
                n_vocab=shape["n_vocab"],
                levels=tuple(shape.get("levels") or ()),
            ),
            warnings=tuple(document["warnings"]),
            document=document,
        )


@dataclass(frozen=True)
class LossPrediction:
    """The loss of a model on some tokens, beside that of the best model for the same FLOPs."""

    law: str
    #: The law of N and D that was asked: ``approach3``, ``approach3-vocab``, ``joint`` or ``joint-repeats``.
    form: str
    #: N, where N_nv and N_v are not told apart; then those are ``None``.
    params: Optional[float]
    params_nonvocab: Optional[float]
    params_vocab: Optional[float]
    n_vocab: Optional[float]
    tokens: float
    flops: float
    loss: float
    #: The best model for ``flops``: ``params`` (or ``params_nonvocab``, ``params_vocab``), ``tokens``,
    #: ``loss_normalised``.
    optimum: Mapping[str, float]
    loss_above_optimum: float
    #: FLOPs with which the best model reaches ``loss``.
    flops_of_equal_loss: Optional[float]
    #: Of ``loss_normalised``, ``optimum_loss`` and ``loss_above_optimum``.
    ci95: Mapping[str, Optional[Interval]]
    extrapolation_factor: float
    warnings: Tuple[str, ...]
    document: Mapping[str, Any] = field(repr=False)

    @staticmethod
    def _of(document: Mapping[str, Any]) -> "LossPrediction":
        return LossPrediction(
            law=document["law"],
            form=document["form"],
            params=document.get("params"),
            params_nonvocab=document.get("params_nonvocab"),
            params_vocab=document.get("params_vocab"),
            n_vocab=document.get("n_vocab"),
            tokens=document["tokens"],
            flops=document["flops"],
            loss=document["loss_normalised"],
            optimum=document["optimum"],
            loss_above_optimum=document["loss_above_optimum"],
            flops_of_equal_loss=document.get("flops_of_equal_loss"),
            ci95={name: _interval(value) for name, value in document["ci95"].items()},
            extrapolation_factor=document["extrapolation_factor"],
            warnings=tuple(document["warnings"]),
            document=document,
        )
