"""Which targets each step supervises: a pure function of seed and step, the built-in trainer's own."""

from typing import NamedTuple

import numpy as np

from .chacha import Stream, each_below

# The shuffle of an epoch takes its stream from here on, what a step draws from there on.
FIRST_EPOCH, FIRST_STEP = 1 << 32, 1 << 33


class Parts(NamedTuple):
    """Clips of a batch, each with its caption and the targets of it that are supervised; arrays `[n]`."""

    clip: np.ndarray
    caption: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def __len__(self):
        return len(self.clip)


class TokenStream:
    """The training split as an endless stream of supervised tokens, shuffled anew each epoch.

    `targets` is how many of them each clip of the training split has, `clips` the clips that are used.
    A clip shows one of its captions, drawn in each epoch, or if `matched` the one that its codes were made with.
    """

    def __init__(self, captions, targets, clips, seed, matched=False):
        self.captions, self.targets, self.clips, self.seed = captions, targets, clips, seed
        self.matched = matched
        self.epoch_tokens = int(targets[clips].sum())
        self.index = None

    def _shuffle(self, index):
        """Fisher and Yates, then a caption for each clip that is shown a drawn one, all from the epoch's own stream."""
        random, order = Stream(self.seed, FIRST_EPOCH + index), self.clips.tolist()
        n = len(order)
        swaps = each_below(random.take(n - 1), np.arange(n, 1, -1)).tolist()
        for i, j in zip(range(n - 1, 0, -1), swaps):
            order[i], order[j] = order[j], order[i]
        order, offsets = np.array(order), self.captions.offsets["train"]
        counts = np.diff(offsets)[order]
        of_clip = order % counts if self.matched else each_below(random.take(n), counts)
        picked = offsets[:-1][order] + of_clip
        self.index, self.order = index, order
        self.shown = self.captions.captions["train"][picked]
        self.starts = np.concatenate([[0], np.cumsum(self.targets[order])])

    def parts(self, position, n):
        """The `n` targets that begin at target `position` of the stream."""
        found = []
        while n > 0:
            index, within = divmod(position, self.epoch_tokens)
            if self.index != index:
                self._shuffle(index)
            end = min(within + n, self.epoch_tokens)
            a = int(np.searchsorted(self.starts, within, "right")) - 1
            b = int(np.searchsorted(self.starts, end, "left"))
            starts = self.starts[a:b]
            first = np.maximum(within - starts, 0)
            last = np.minimum(end, self.starts[a + 1 : b + 1]) - starts
            found.append(Parts(self.order[a:b], self.shown[a:b], first, last))
            position, n = position + end - within, n - (end - within)
        return Parts(*(np.concatenate(own) for own in zip(*found)))
