"""LG-Tok's scale-by-scale transformer: the codes of a scale all at once, from the text, the length of the clip
and the scales before."""

import numpy as np
import torch
from torch import nn

from .chacha import Stream
from .draws import corrupted
from .heads import Headed, table_rows, targets_by_head
from .network import empty, product
from .packing import Layout, Packed, n_words, on_device, spans, text_rows
from .scale_inputs import scale_inputs
from .stream import FIRST_STEP, Parts

# The span of a clip in angles, whatever the length of a scale.
SPAN = 64.0


class Places:
    """Where text and codes stand in time: the last word of a text at -1, the others before it, code j of s at
    the middle of what it covers, 64 (j + 1/2) / s."""

    def __init__(self, generator, scales):
        longest = [scale.codes(generator["most_latents"] * generator["frames_per_latent"]) for scale in scales]
        self.longest = np.array(longest)
        self.n_text = generator["shape"]["n_ctx"] - int(self.longest.sum())
        self.starts = self.n_text + np.cumsum(self.longest) - self.longest
        slots = [SPAN * (np.arange(n) + 0.5) / max(1, n) for n in longest]
        self.positions = np.concatenate([np.arange(self.n_text) - float(self.n_text), *slots])


class Scalewise(Headed):
    """`[text | scale 1 | scale 2 | ...]`: a row sees text and its own and earlier scales.

    The rows of scale 1 are learned, those of later scales what the scales before them make of the latents.
    """

    def __init__(self, generator, codes, vectors, inputs):
        shape, places = generator["shape"], Places(generator, codes.scales)
        super().__init__(shape, vectors, places.positions)
        d, self.n_heads = shape["d_model"], len(codes.scales)
        self.starts = empty(int(places.longest[0]), d)
        self.lengths = empty(generator["most_latents"], d)
        self.levels = empty(self.n_heads, d)
        self.input_weight, self.input_bias = empty(generator["d_latent"], d), empty(d)
        self.heads = nn.ParameterList(empty(d, scale.n_vocab) for scale in codes.scales)
        self.inputs = inputs

    def classes(self):
        return list(self.heads)

    def embedded(self, batch):
        """Text and first scale with the clip's length, later scales with their inputs, `[n, d]`."""
        level = batch["level"]
        x = table_rows(self.starts, batch["slot"]) + table_rows(self.lengths, batch["length"])
        x = x + table_rows(self.levels, level)
        x = x + torch.where(level[:, None] < 0, self.text(batch)[batch["text_at"]], 0.0)
        if len(batch.get("shown_first", ())) == 0:
            return x
        shown = self.inputs(batch["ids"], batch["shown_first"], batch["shown_latents"], self.dtype)
        inputs = product(shown, self.input_weight, self.dtype) + self.input_bias
        return x + torch.where(level[:, None] > 0, inputs[batch["input_at"]], 0.0)


def seen(ends):
    """What the rows of codes see: text, and the codes of their clip up to `ends`, `[codes]`."""

    def sees(_sequence, place, prefix):
        visible = prefix.copy()
        visible[place >= prefix] += ends
        return visible

    return sees


class NextScale:
    """The scale-by-scale transformer on the batches of a run."""

    def __init__(self, spec, codes, captions):
        self.spec, self.codes, self.captions = spec, codes, captions
        self.own, self.places = spec.generator, Places(spec.generator, codes.scales)
        inputs = scale_inputs(spec.tokenizer, codes, self.own["frames_per_latent"])
        self.model = Scalewise(self.own, codes, captions.vectors, inputs)
        self.ids = {split: codes.stream(split) for split in codes.frames}
        self.lengths = {split: codes.lengths(split) for split in codes.frames}
        self.n_vocab = np.array([scale.n_vocab for scale in codes.scales])
        self.stream = spec.stream(captions, codes.n_targets("train"), codes)
        self.uniform_nats = float(np.log(self.n_vocab.max()))
        self.unigram = codes.unigram()

    def batch(self, step):
        """The batch of a step, which counts from 0."""
        spec, own = self.spec, self.own
        parts = self.stream.parts(step * spec.batch_tokens, spec.batch_tokens)
        lengths = self.lengths["train"][parts.clip]
        scale = self._scales(lengths)[1]
        start = self.codes.starts()[scale]
        drawn = corrupted(
            Stream(spec.seed, FIRST_STEP + step),
            self._codes("train", parts.clip) - start,
            lengths.sum(1),
            self.n_vocab[scale],
            own["text_drop"],
            own["corruption"],
        )
        parts = Parts(parts.clip, np.where(drawn.without_text, -1, parts.caption), parts.first, parts.last)
        return self.packed("train", parts, drawn.codes + start)

    def _codes(self, split, clips):
        """The codes of clips, as ids of one vocabulary."""
        clip, place = spans(self.lengths[split][clips].sum(1))
        return self.ids[split][self.codes.offsets[split][clips][clip] + place]

    def _scales(self, lengths):
        """The clip, the scale and the place on it of each code of clips."""
        block, slot = spans(lengths.ravel())
        return *np.divmod(block, len(self.n_vocab)), slot

    def packed(self, split, parts, shown):
        """Parts of a split as a batch, with the codes that it shows."""
        lengths, prefix = self.lengths[split][parts.clip], n_words(self.captions, parts.caption)
        clip, scale, slot = self._scales(lengths)
        layout = Layout.of(prefix, lengths.sum(1), seen(np.cumsum(lengths, 1)[clip, scale]))
        words, text_at = text_rows(self.captions, parts.caption, layout)
        strides = self.codes.frames[split][parts.clip] // self.own["frames_per_latent"]
        rows = self._rows(layout, strides, (clip, scale, slot), shown)
        groups = {"row": rows | {"text_at": text_at}, "word": {"words": words}}
        if self.model.inputs is not None:
            groups["shown"] = self.model.inputs.shown(layout.starts + prefix, strides)
        # Codes that are supervised, among all of the batch.
        asked, place = spans(parts.last - parts.first)
        n_codes = lengths.sum(1)
        at = (np.cumsum(n_codes) - n_codes + parts.first)[asked] + place
        codes = (self._codes(split, parts.clip) - self.codes.starts()[scale])[at]
        asked_rows = np.flatnonzero(~layout.is_text)[at]
        groups |= targets_by_head(scale[at], asked_rows, codes, len(self.n_vocab))
        columns = int(self.n_vocab[scale[at]].sum()) + int((scale > 0).sum()) * self.own["d_latent"]
        return Packed(groups, layout, self.spec.forward_flops(layout, len(words), columns))

    def _rows(self, layout, strides, codes, shown):
        """The arrays of the rows of a batch; -1 stands for no slot, no level, no length."""
        clip, scale, slot = codes
        row, n = np.flatnonzero(~layout.is_text), len(layout.place)

        def of_codes(values, others):
            array = np.zeros(n, np.int64) + others
            array[row] = values
            return array

        angle = self.places.n_text - layout.prefix[layout.sequence] + layout.place
        length = strides.clip(1, self.own["most_latents"]) - 1
        rows = {"ids": of_codes(shown, 0), "level": of_codes(scale, -1)}
        rows["slot"] = of_codes(np.where(scale == 0, slot, -1), -1)
        rows["length"] = of_codes(np.where(scale == 0, length[clip], -1), length[layout.sequence])
        rows["angle"] = of_codes(self.places.starts[scale] + slot, angle)
        if self.model.inputs is not None:
            # Rows without inputs have some or other, as those of codes have some word.
            later = scale > 0
            rows["input_at"] = np.arange(n) % max(1, int(later.sum()))
            at = self.model.inputs.at(strides, clip[later], scale[later], slot[later])
            rows["input_at"][row[later]] = at
        return rows

    def measured(self, split, clips, device):
        """-ln p of the codes of whole clips, those of the unigram model, the clip and the scale of each, and the
        likeliest codes in their places, by scale; a tuple of arrays a scale."""
        lengths = self.lengths[split][clips]
        ends = lengths.sum(1)
        parts = Parts(clips, self.captions.shown(split)[clips], ends * 0, ends)
        packed = self.packed(split, parts, self._codes(split, clips))
        found = self.model.target_nll(on_device(packed.as_it_is(), device))
        for k, ((nll, likeliest), start) in enumerate(zip(found, self.codes.starts())):
            clip, _ = spans(lengths[:, k])
            ids = start + packed.groups[f"target_{k}"][f"targets_{k}"]
            used = (k, likeliest.cpu().numpy())
            yield nll.double().cpu().numpy(), self.unigram[ids], clips[clip], clip * 0 + k, used
