"""MoMask's second stage: the codes of a layer all at once, from the text and the codes of the layers before."""

from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from .chacha import Stream, units
from .heads import Headed, table_rows, targets_by_head
from .masked import HiddenCodes, whole
from .network import empty
from .packing import Packed, n_words, on_device, spans, text_rows
from .stream import FIRST_STEP, Parts


class LaterLayers(Headed):
    """`[text | places]`: a place is the sum of its codes' embeddings in the layers before and a vector of the
    layer that is asked for, counted from 0 for the second; every row sees every other."""

    def __init__(self, shape, codes, vectors):
        super().__init__(shape, vectors, range(shape["n_ctx"]))
        d, self.sizes = shape["d_model"], [scale.n_vocab for scale in codes.scales]
        self.n_heads = len(self.sizes) - 1
        self.embedding, self.layers = empty(sum(self.sizes[:-1]), d), empty(self.n_heads, d)
        own = self.sizes[-1:] if shape["tie_embeddings"] else self.sizes[1:]
        self.heads = nn.ParameterList(empty(d, n) for n in own)

    def classes(self):
        """Where embeddings are tied, only the last layer has a matrix of its own."""
        tied = self.n_heads - len(self.heads)
        tables = self.embedding.split(self.sizes[:-1])[1 : 1 + tied]
        return [table.T for table in tables] + list(self.heads)

    def embedded(self, batch):
        """Projected words, and places, `[n, d]`."""
        layer = batch["layer"][:, None]
        x = torch.where(layer < 0, self.text(batch)[batch["text_at"]], 0.0)
        for k in range(self.n_heads):
            x = x + torch.where(layer >= k, self.embedding[batch[f"ids_{k}"]], 0.0)
        return x + table_rows(self.layers, batch["layer"])


class Stages(nn.Module):
    """Both stages, which share no parameter."""

    def __init__(self, base, residual):
        super().__init__()
        self.base, self.residual = base, residual

    @property
    def dtype(self):
        return self.base.dtype

    @dtype.setter
    def dtype(self, dtype):
        self.base.dtype = self.residual.dtype = dtype

    def compile_parts(self):
        self.base.compile_parts()
        self.residual.compile_parts()

    def optional(self, batch):
        return self.residual.optional(stage(batch, "residual"))

    def forward(self, batch):
        """1/K of the first stage's loss and (K - 1)/K of the second's, K layers: nats a code."""
        first, later = self.base(stage(batch, "base")), self.residual(stage(batch, "residual"))
        share = 1 / (self.residual.n_heads + 1)
        return first * share + later * (1 - share)


def stage(named, name):
    """What belongs to a stage, by the names that it has there."""
    return {key[len(name) + 1 :]: own for key, own in named.items() if key.startswith(name + ".")}


class Both(NamedTuple):
    """The batches of both stages, as one."""

    base: Packed
    residual: Packed

    @property
    def forward_flops(self):
        return self.base.forward_flops + self.residual.forward_flops

    def _named(self, of):
        stages = self._asdict().items()
        return {f"{name}.{key}": own for name, packed in stages for key, own in of(name, packed).items()}

    def sizes(self):
        return self._named(lambda _, packed: packed.sizes())

    def as_it_is(self):
        return self._named(lambda _, packed: packed.as_it_is())

    def padded(self, room):
        return self._named(lambda name, packed: packed.padded(stage(room, name)))


class TwoStages:
    """Both stages on the batches of a run, side by side on the same clips.

    A place of a clip is two tokens, one of each stage. Where a step takes an odd number of tokens, the two
    of a place stand in two steps.
    """

    def __init__(self, spec, codes, captions):
        self.spec, self.codes, self.captions = spec, codes, captions
        if spec.batch_tokens < 2:
            raise SystemExit("two stages need steps of at least two tokens: set train.batch")
        self.first = HiddenCodes(spec, codes, captions)
        residual = LaterLayers(spec.shape, codes, captions.vectors)
        self.model = Stages(self.first.model, residual)
        self.places, self.n_vocab = self.first.places, np.array(residual.sizes)
        self.ids = {split: codes.stream(split) for split in codes.frames}
        self.uniform_nats = float(np.log(self.n_vocab.max() + 1))
        self.unigram = codes.unigram()

    def batch(self, step):
        """The batch of a step, which counts from 0. Tokens 2 p and 2 p + 1 are those of place p, the first
        stage's before the second's."""
        spec, stream = self.spec, self.first.stream
        start, end = step * spec.batch_tokens, (step + 1) * spec.batch_tokens
        first = stream.parts((start + 1) // 2, (end + 1) // 2 - (start + 1) // 2)
        later = stream.parts(start // 2, end // 2 - start // 2)
        random = Stream(spec.seed, FIRST_STEP + step)
        base = self.first.drawn(first, random)
        drawn = units(random.take(2 * len(later)))
        caption = np.where(drawn[::2] < spec.generator["text_drop"], -1, later.caption)
        later = Parts(later.clip, caption, later.first, later.last)
        return Both(base, self.packed("train", later, drawn_layer(len(self.n_vocab), drawn[1::2])))

    def packed(self, split, parts, layer):
        """Parts of a split as a batch of the second stage, with the layer that each is asked for."""
        n, starts = self.places[split][parts.clip], self.codes.offsets[split][parts.clip]
        layout = whole(n_words(self.captions, parts.caption), n)
        words, text_at = text_rows(self.captions, parts.caption, layout)
        rows = self._rows(layout, self.ids[split], (n, starts, layer)) | {"text_at": text_at}
        clip, place = spans(parts.last - parts.first)
        place = parts.first[clip] + place
        codes = self.codes.codes[split][starts[clip] + (layer + 1)[clip] * n[clip] + place]
        asked = (layout.starts + layout.prefix)[clip] + place
        groups = {"row": rows | {"angle": layout.place}, "word": {"words": words}}
        groups |= targets_by_head(layer[clip], asked, codes, len(self.n_vocab) - 1)
        columns = int(self.n_vocab[layer[clip] + 1].sum())
        return Packed(groups, layout, self.spec.forward_flops(layout, len(words), columns))

    def _rows(self, layout, ids, clips):
        """For each row the layer that is asked for, -1 for text, and its codes in all layers but the last; those
        that are not shown are some or other."""
        n, starts, layer = clips
        clip, place = spans(n)
        is_code, others = ~layout.is_text, np.arange(len(layout.place))
        asked = np.full(len(layout.place), -1)
        asked[is_code] = layer[clip]
        rows = {"layer": asked}
        for k in range(len(self.n_vocab) - 1):
            codes = others % int(self.n_vocab[:-1].sum())
            shown = layer[clip] >= k
            codes[np.flatnonzero(is_code)[shown]] = ids[(starts[clip] + k * n[clip] + place)[shown]]
            rows[f"ids_{k}"] = codes
        return rows

    def measured(self, split, clips, device):
        """Of the first layer a bound, of each later one -ln p given those before it; a tuple a layer."""
        yield from self.first.measured(split, clips, device)
        n_later = len(self.n_vocab) - 1
        asked, layer = np.repeat(clips, n_later), np.tile(np.arange(n_later), len(clips))
        n = self.places[split][asked]
        packed = self.packed(split, Parts(asked, self.captions.shown(split)[asked], n * 0, n), layer)
        found = self.model.residual.target_nll(on_device(packed.as_it_is(), device))
        clip, _ = spans(self.places[split][clips])
        for k, ((nll, likeliest), start) in enumerate(zip(found, self.codes.starts()[1:]), 1):
            ids = start + packed.groups[f"target_{k - 1}"][f"targets_{k - 1}"]
            used = (k, likeliest.cpu().numpy())
            yield nll.double().cpu().numpy(), self.unigram[ids], clips[clip], clip * 0 + k, used


def drawn_layer(n_layers, u):
    """The layers that `u`, drawn evenly from 0 to 1, ask for, from 0 for the second: the first layers come more
    often, as in MoMask."""
    return np.floor((1 - np.cos(np.pi / 2 * u)) * (n_layers - 2) + 0.5).astype(np.int64)
