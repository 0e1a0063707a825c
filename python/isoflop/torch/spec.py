"""The run as isoflop describes it (docs/custom-trainer.md)."""

import json
import math

import numpy as np

from .stream import TokenStream


class RunSpec:
    """The keys of the specification as attributes, and what follows from them."""

    def __init__(self, path):
        with open(path) as file:
            self.__dict__.update(json.load(file))
        if self.codes is None or self.text is None:
            raise SystemExit("the torch trainer learns from codes and captions: give the sweep a `data` source")

    def training_clips(self, codes):
        """The clips of the training split that the run sees."""
        return np.arange(codes.n_clips("train")) if self.clips is None else np.array(self.clips)

    def stream(self, captions, targets, codes):
        """The training split as the run sees it; `targets` is how many of them each clip has."""
        return TokenStream(captions, targets, self.training_clips(codes), self.seed, self.captions == "matched")

    def learning_rate(self, step):
        """The rate of a step, from 0: up in a line, then half a cosine, or level and down by 1 - sqrt."""
        lr = self.lr
        peak, warmup, least = lr["peak"], lr["warmup_steps"], lr["final_share"]
        if step < warmup:
            return peak * (step + 1) / (warmup + 1)
        if lr["schedule"] == "wsd":
            height = 1 - math.sqrt(share(self.steps - lr["decay_steps"], step, self.steps))
        else:
            height = (1 + math.cos(math.pi * share(warmup, step, self.steps))) / 2
        return peak * (least + (1 - least) * height)

    def is_due(self, step):
        """Whether the model is measured on the validation split after so many steps."""
        return step * self.evaluations // self.steps != (step - 1) * self.evaluations // self.steps

    def forward_flops(self, layout, n_words, n_logits):
        """Multiply-adds of a batch, times two: each row sees what it sees; `n_logits` columns of heads."""
        shape = self.shape
        d, n_layer = shape["d_model"], shape["n_layer"]
        matrices = 3 if shape["ffn"] == "swiglu" else 2
        block = 4 * d * d + matrices * d * shape["d_ff"]
        blocks = n_layer * (len(layout.place) * block + 2 * d * layout.pairs())
        return 2.0 * (blocks + n_words * shape["d_text"] * d + n_logits * d)


def share(first, step, last):
    """How much of `first..last` is over at the beginning of a step; 0 before."""
    return max(0, step - first) / max(1, last - first)
