"""MoMask's masked transformer: hidden codes from the text and the codes that are not hidden.

The network is the autoregressive transformer's; the row of the end token's embedding stands for a hidden code.
"""

import numpy as np

from .autoregressive import Autoregressive
from .chacha import Stream
from .draws import hidden, hidden_codes
from .learning import passes
from .packing import Layout, Packed, n_words, on_device, spans, text_rows
from .stream import FIRST_STEP, Parts

# How often each clip is measured, and the seed of what is hidden then: the same for every model.
MASKS, SEED = 4, 0
# Clips are shifted against one another by the golden section, which fills a span evenly.
GOLDEN = 0.618033988749895


def whole(prefix, codes):
    """Sequences of which each row sees all."""
    layout = Layout.of(prefix, codes, lambda _sequence, place, _prefix: place)
    return layout._replace(last=layout.first + layout.lengths[layout.sequence])


class HiddenCodes:
    """The masked transformer on the batches of a run: of codes of several layers, the first layer's."""

    def __init__(self, spec, codes, captions):
        self.spec, self.codes, self.captions = spec, codes, captions
        self.own, self.n_vocab = spec.generator, codes.scales[0].n_vocab
        self.model = Autoregressive(spec.shape, self.n_vocab, captions.vectors)
        self.places = {split: codes.lengths(split)[:, 0] for split in codes.frames}
        self.stream = spec.stream(captions, self.places["train"], codes)
        self.uniform_nats = float(np.log(self.n_vocab + 1))
        self.unigram, self.masks = codes.unigram(), {}

    def batch(self, step):
        """The batch of a step, which counts from 0."""
        n = self.spec.batch_tokens
        parts = self.stream.parts(step * n, n)
        return self.drawn(parts, Stream(self.spec.seed, FIRST_STEP + step))

    def drawn(self, parts, random):
        """Parts of training clips as a batch, with what a step draws."""
        own, n = self.own, self.places["train"][parts.clip]
        codes = self._codes("train", parts.clip)
        found = hidden(random, codes, n, parts, self.n_vocab, own["text_drop"], own["corruption"])
        caption = np.where(found.without_text, -1, parts.caption)
        return self.packed(caption, n, codes, found.is_target, found.shown)

    def _codes(self, split, clips):
        """The codes of clips."""
        clip, place = spans(self.places[split][clips])
        return self.codes.codes[split][self.codes.offsets[split][clips][clip] + place]

    def packed(self, caption, n_codes, codes, is_target, shown):
        """Clips as a batch, by their captions and codes."""
        layout = whole(n_words(self.captions, caption), n_codes)
        words, text_at = text_rows(self.captions, caption, layout)
        # Rows of text have some code or other, which is not looked at.
        ids = np.arange(len(layout.place)) % self.n_vocab
        ids[~layout.is_text] = shown
        rows = {"ids": ids, "text_at": text_at, "is_text": layout.is_text.astype(np.int64)}
        asked = codes[is_target]
        targets = {"rows": np.flatnonzero(~layout.is_text)[is_target], "targets": asked}
        groups = {"row": rows | {"angle": layout.place}, "word": {"words": words}}
        groups["target"] = targets | {"valid": np.ones_like(asked)}
        flops = self.spec.forward_flops(layout, len(words), len(asked) * (self.n_vocab + 1))
        return Packed(groups, layout, flops)

    def measured(self, split, clips, device):
        """A bound on the nats of each code of whole clips, those of the unigram model, the clip and the scale
        of each, and the likeliest codes in the hidden places, by scale.

        Of m hidden codes of n, m drawn evenly from 1 to n, the mean of -ln p bounds the nats of a code
        (Uria et al. 2014; Hoogeboom et al. 2022): it stands for every code of the clip.
        """
        n, codes = self.places[split][clips], self._codes(split, clips)
        clip, _ = spans(n)
        caption, bound, used = self.captions.shown(split)[clips], np.zeros(len(clips)), []
        for is_hidden in self._masks(split)[clips[0]]:
            shown = np.where(is_hidden, self.n_vocab, codes)
            packed = self.packed(caption, n, codes, is_hidden, shown)
            nll, likeliest = self.model.target_nll(on_device(packed.as_it_is(), device))
            used.append(likeliest.cpu().numpy())
            own, nll = clip[is_hidden], nll.double().cpu().numpy()
            bound += np.bincount(own, nll, len(clips)) / (MASKS * np.bincount(own, minlength=len(clips)))
        yield bound[clip], self.unigram[codes], clips[clip], clip * 0, (0, np.concatenate(used))

    def _masks(self, split):
        """What is hidden when a split is measured, by the first clip of each pass; drawn pass after pass."""
        if split not in self.masks:
            random, found = Stream(SEED, 0), {}
            for clips in passes(self.codes.n_targets(split), self.spec.targets_per_pass):
                found[clips[0]] = [self._mask(split, clips, mask, random) for mask in range(MASKS)]
            self.masks[split] = found
        return self.masks[split]

    def _mask(self, split, clips, mask, random):
        n = self.places[split][clips]
        counts = 1 + ((mask + clips * GOLDEN % 1.0) / MASKS * n).astype(np.int64)
        firsts = np.cumsum(counts) - counts
        return hidden_codes(random.take(int(counts.sum())), firsts, n, counts)


def masked(spec, codes, captions):
    """The objective of a masked generator: codes of several layers have a second stage."""
    from .residual import TwoStages

    return (TwoStages if len(codes.scales) > 1 else HiddenCodes)(spec, codes, captions)
