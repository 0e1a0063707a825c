"""ScaMo's text-prefix transformer: each code from the text and the codes before it."""

import numpy as np
import torch

from .network import Network, empty
from .packing import Layout, Packed, n_words, on_device, spans, text_rows
from .stream import Parts


class Autoregressive(Network):
    """`[text | codes]`: the last word predicts the first code, each code the next, the last one the end.

    Codes of several scales are one sequence, and their codebooks one vocabulary.
    """

    def __init__(self, shape, n_vocab, vectors):
        super().__init__(shape, vectors, range(shape["n_ctx"]))
        d = shape["d_model"]
        self.n_vocab = n_vocab
        # Codes, end, pad.
        self.embedding = empty(n_vocab + 2, d)
        self.head = None if shape["tie_embeddings"] else empty(d, n_vocab + 1)

    def embedded(self, batch):
        """Projected words and embedded codes, `[n, d]`."""
        words, codes = self.text(batch), self.embedding[batch["ids"]]
        return torch.where(batch["is_text"][:, None] != 0, words[batch["text_at"]], codes)

    def features(self, batch):
        """What the blocks make of the rows that predict targets, `[s, d]`."""
        return self.stacked(self.part("embedded")(batch), batch)[batch["rows"]]

    def classes(self):
        return self.embedding[: self.n_vocab + 1].T if self.head is None else self.head

    def forward(self, batch):
        """Mean cross-entropy of the targets of a batch, in nats."""
        weights = batch["valid"] / batch["valid"].sum()
        return self.part("head_loss")(self.features(batch), self.classes(), batch["targets"], weights)

    def target_nll(self, batch):
        """-ln p of each target of a batch, in nats, and the likeliest id in its place."""
        return self.head_nll(self.features(batch), self.classes(), batch["targets"])


class NextCode:
    """The autoregressive transformer on the batches of a run."""

    def __init__(self, spec, codes, captions):
        self.spec, self.codes, self.captions = spec, codes, captions
        self.model = Autoregressive(spec.shape, codes.n_vocab, captions.vectors)
        self.ids = {split: codes.stream(split) for split in codes.frames}
        self.stream = spec.stream(captions, codes.n_targets("train"), codes)
        self.uniform_nats = float(np.log(codes.n_vocab + 1))
        self.unigram = codes.unigram()

    def batch(self, step):
        """The batch of a step, which counts from 0."""
        n = self.spec.batch_tokens
        return self.packed("train", self.stream.parts(step * n, n))

    def packed(self, split, parts):
        """Parts of a split as a batch."""
        prefix, inputs = n_words(self.captions, parts.caption), parts.last - 1
        layout = Layout.of(prefix, inputs, lambda _sequence, place, _prefix: place + 1)
        words, text_at = text_rows(self.captions, parts.caption, layout)
        first_code = self.codes.offsets[split][parts.clip]
        rows = {"ids": self._shown(split, layout, first_code), "text_at": text_at}
        rows |= {"is_text": layout.is_text.astype(np.int64), "angle": layout.place}
        part, place = spans(parts.last - parts.first)
        target = parts.first[part] + place
        n_codes = np.diff(self.codes.offsets[split])[parts.clip]
        is_code = target < n_codes[part]
        asked = np.full(len(target), self.codes.n_vocab)
        asked[is_code] = self.ids[split][(first_code[part] + target)[is_code]]
        row = (layout.starts + prefix - 1)[part] + target
        targets = {"rows": row, "targets": asked, "valid": np.ones_like(asked)}
        flops = self.spec.forward_flops(layout, len(words), len(asked) * (self.codes.n_vocab + 1))
        return Packed({"row": rows, "word": {"words": words}, "target": targets}, layout, flops)

    def _shown(self, split, layout, first_code):
        """The code of each row; rows of text have some code or other, which is not looked at."""
        ids = np.arange(len(layout.place)) % self.codes.n_vocab
        is_code = ~layout.is_text
        of_row = (first_code - layout.prefix)[layout.sequence] + layout.place
        ids[is_code] = self.ids[split][of_row[is_code]]
        return ids

    def measured(self, split, clips, device):
        """-ln p of the targets of whole clips, those of the unigram model, the clip and the scale of each, and the
        likeliest ids in the places of codes, by scale; a tuple of arrays a pass."""
        ends, lengths = self.codes.n_targets(split)[clips], self.codes.lengths(split)[clips]
        packed = self.packed(split, Parts(clips, self.captions.shown(split)[clips], ends * 0, ends))
        nll, likeliest = self.model.target_nll(on_device(packed.as_it_is(), device))
        clip, place = spans(ends)
        used = likeliest.cpu().numpy()[place < lengths.sum(1)[clip]]
        scale = spans(lengths.ravel())[0] % lengths.shape[1]
        unigram = self.unigram[packed.groups["target"]["targets"]]
        yield nll.double().cpu().numpy(), unigram, clips[clip], clip * 0, (scale, used)
