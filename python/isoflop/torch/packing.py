"""Batches packed row after row: `[text | codes]` of each clip, and which rows a row sees.

A row sees the rows of an interval, `first <= k < last`: text sees its text, a code what lies before it, a
scale all up to its own end. So one pair of numbers a row is the mask of every generator.
"""

from typing import NamedTuple

import numpy as np
import torch

BLOCK = 128


def spans(lengths):
    """Of items that lie one after another, for each place: its item, and its place within it."""
    item = np.repeat(np.arange(len(lengths)), lengths)
    starts = np.cumsum(lengths) - lengths
    return item, np.arange(len(item)) - starts[item]


class Layout(NamedTuple):
    """Rows of a batch before any padding.

    `sequence` `[n_rows]` and `place` `[n_rows]` say where a row stands, `prefix` `[n_sequences]` how many rows
    of text a sequence begins with, `first` and `last` `[n_rows]` what a row sees.
    """

    sequence: np.ndarray
    place: np.ndarray
    lengths: np.ndarray
    prefix: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @classmethod
    def of(cls, prefix, codes, sees):
        """Sequences of so many rows of text and of codes; `sees(sequence, place, prefix)` gives, for rows of
        codes, how many rows of its sequence each sees."""
        lengths = prefix + codes
        sequence, place = spans(lengths)
        start = (np.cumsum(lengths) - lengths)[sequence]
        before = prefix[sequence]
        visible = np.where(place < before, before, sees(sequence, place, before))
        return cls(sequence, place, lengths, prefix, start, start + visible)

    @property
    def starts(self):
        """The first row of each sequence."""
        return np.cumsum(self.lengths) - self.lengths

    @property
    def is_text(self):
        return self.place < self.prefix[self.sequence]

    def pairs(self):
        """Pairs of rows of which one sees the other."""
        return int((self.last - self.first).sum())


def text_rows(captions, shown, layout):
    """The words of captions, one after another, and for each row of text its place among them; rows of codes
    have some place or other, since one that all of them had would be slow to sum gradients for.

    Caption -1 is one that is left out: one word, the last row of the vectors.
    """
    first = np.where(shown < 0, len(captions.vectors) - 1, captions.first_word[shown])
    caption, place = spans(layout.prefix)
    at = np.arange(len(layout.place)) % len(caption)
    at[layout.is_text] = np.arange(len(caption))
    return first[caption] + place, at


def n_words(captions, shown):
    """Words of each caption; a caption that is left out is one vector."""
    return np.where(shown < 0, 1, captions.n_words[shown])


class Packed(NamedTuple):
    """A batch on the host.

    `groups` has arrays of whole numbers by name, in groups that are equally long: `row` a row of the batch,
    `word` a word of the captions, `target` (or one group a scale) what is supervised.
    """

    groups: dict
    layout: Layout
    # Of a forward pass, each sequence at its own length.
    forward_flops: float

    def sizes(self):
        return {name: len(next(iter(own.values()))) for name, own in self.groups.items()}

    def as_it_is(self):
        """The arrays without padding, and where each row stands in a grid of sequences by places."""
        _, place, lengths, *_ = self.layout
        grid = np.full((len(lengths), int(lengths.max())), -1)
        at = self.layout.sequence * grid.shape[1] + place
        grid.ravel()[at] = np.arange(len(place))
        arrays = {"first": self.layout.first, "last": self.layout.last, "grid": grid, "grid_at": at}
        return arrays | {name: own for group in self.groups.values() for name, own in group.items()}

    def padded(self, room):
        """The arrays at the sizes of `room`; targets of padding are not valid, its rows see themselves."""
        n, rows = len(self.layout.place), np.arange(room["row"])
        arrays = {
            "first": np.concatenate([self.layout.first, rows[n:]]),
            "last": np.concatenate([self.layout.last, rows[n:] + 1]),
        }
        for group, own in self.groups.items():
            for name, array in own.items():
                arrays[name] = np.concatenate([array, np.zeros(room[group] - len(array), np.int64)])
        return arrays


def room_for(sizes, before):
    """Sizes to pad batches to, at least those before: some more than is wanted, in whole blocks."""
    room = dict(before)
    for group, n in sizes.items():
        if n > room.get(group, -1):
            room[group] = -(-(n + n // 50) // BLOCK) * BLOCK
    return room


def on_device(arrays, device):
    return {name: torch.from_numpy(array).to(device) for name, array in arrays.items()}
