"""What a step draws: codes that are shown as random ones, and codes that are hidden.

The numbers are those of the built-in trainer in its order. How many numbers a clip takes depends on the
numbers themselves, so the clips are walked one by one, and all that need not be is done for all at once.
"""

import math
from typing import NamedTuple

import numpy as np

from .chacha import each_below, units
from .packing import spans


class Numbers:
    """The raw numbers of a stream by their place, and the same in [0, 1)."""

    def __init__(self, stream, n):
        self.stream, self.raw = stream, ()
        self.at_least(n)

    def at_least(self, n):
        """Draws more, if there are fewer than `n`; whether it did."""
        if n <= len(self.raw):
            return False
        self.raw = self.stream.peek(max(n, 2 * len(self.raw)))
        self.units = units(self.raw)
        return True


class Corrupted(NamedTuple):
    """For each clip, whether its caption is left out; codes as they are shown."""

    without_text: np.ndarray
    codes: np.ndarray


def corrupted(stream, codes, n_codes, n_vocab, text_drop, share):
    """Clips of `n_codes` codes each, of which a share is replaced by random ones below `n_vocab`, `[codes]`.

    A clip takes a number for its caption, then one for each code, and where that is hit one more, which
    is the code that is shown.
    """
    numbers, hits, texts, ends = walked(stream, n_codes, share)
    clip, place = spans(ends - texts - 1)
    at = texts[clip] + 1 + place
    asked = at[np.minimum(hits.before[at], place) % 2 == 0]
    hit, shown = hits.hit[asked], codes.copy()
    shown[hit] = each_below(numbers.raw[asked[hit] + 1], n_vocab[hit])
    return Corrupted(numbers.units[texts] < text_drop, shown)


def walked(stream, n_codes, share):
    """The numbers of clips, which of them hit, and for each clip the place of the first and the end."""
    wanted = int(n_codes.sum() * (1 + share)) + len(n_codes)
    numbers = Numbers(stream, wanted + wanted // 16 + int(n_codes.max()) + 64)
    hits, at = Hits(numbers, share), 0
    texts, ends = np.zeros_like(n_codes), np.zeros_like(n_codes)
    for clip, n in enumerate(n_codes.tolist()):
        if numbers.at_least(at + 2 * n + 2):
            hits = Hits(numbers, share)
        texts[clip], at = at, hits.end(at + 1, n)
        ends[clip] = at
    return numbers, hits, texts, ends


class Hits:
    """Which numbers ask for a code to be replaced, if each clip begins with a question.

    After a hit comes a value, whatever it is, so that of a run of hits each second one is a question:
    a number is a question if the hits just before it are even in number.
    """

    def __init__(self, numbers, share):
        self.hit = numbers.units < share
        place = np.arange(len(self.hit))
        missed = np.maximum.accumulate(np.where(self.hit, -1, place))
        # Hits just before each number, and the first number from each on that is no hit.
        self.before = place - 1 - np.concatenate([[-1], missed[:-1]])
        end = np.where(self.hit, len(place), place)
        self.next_miss = np.minimum.accumulate(end[::-1])[::-1]
        is_question = self.before % 2 == 0
        self.questions = np.flatnonzero(is_question)
        # Questions before each number.
        self.count = np.cumsum(is_question) - is_question

    def end(self, first, n):
        """Where the numbers of `n` questions end of which the first is `first`."""
        if n == 0:
            return first
        last = self._last(first, n)
        return int(last + 1 + self.hit[last])

    def _last(self, first, n):
        if self.before[first] == 0:
            return self.questions[self.count[first] + n - 1]
        # The run of hits that the first question stands in, with the number after it, is counted anew.
        miss = self.next_miss[first]
        own = (miss - first) // 2 + 1
        if n <= own:
            return first + 2 * (n - 1)
        return self.questions[self.count[miss + 1] + n - own - 1]


class Hidden(NamedTuple):
    """For each clip, whether its caption is left out; for each code, whether it is hidden and supervised;
    codes as they are shown."""

    without_text: np.ndarray
    is_target: np.ndarray
    shown: np.ndarray


def hidden(stream, codes, n_codes, parts, n_vocab, text_drop, share):
    """Clips of `n_codes` codes each, of which some are hidden, shown as code `n_vocab`; of those that are
    supervised a share is shown as random ones. The stream stands behind what was drawn.

    A clip takes a number for its caption, one for how many codes are hidden, one for each of these, and for
    each that is supervised one, or two where it is shown as a random one.
    """
    numbers = Numbers(stream, int(2 * n_codes.sum()) + 2 * len(n_codes) + 64)
    walk = Walk(numbers, n_codes, share)
    for clip in range(len(n_codes)):
        walk.take(clip, parts.first[clip], parts.last[clip])
    is_hidden = hidden_codes(numbers.raw, walk.firsts, n_codes, walk.counts)
    is_target = targets_of(is_hidden, n_codes, parts)
    shown, asked = np.where(is_hidden | is_target, n_vocab, codes), np.array(walk.asked, np.int64)
    hit = numbers.units[asked] < share
    shown[np.flatnonzero(is_target)[hit]] = each_below(numbers.raw[asked[hit] + 1], n_vocab)
    stream.take(walk.at)
    return Hidden(numbers.units[walk.firsts - 2] < text_drop, is_target, shown)


class Walk:
    """Where the numbers of clips stand: for each clip the first of those that choose what is hidden, and how
    many these are; for each supervised code the one that asks whether it is shown as a random one."""

    def __init__(self, numbers, n_codes, share):
        self.numbers, self.n_codes, self.share, self.at, self.asked = numbers, n_codes, share, 0, []
        self.firsts, self.counts = np.zeros_like(n_codes), np.zeros_like(n_codes)

    def take(self, clip, first, last):
        """Goes on by a clip of which codes `first..last` are supervised."""
        n, numbers = int(self.n_codes[clip]), self.numbers
        numbers.at_least(self.at + 3 * n + 2)
        part = math.cos(math.pi / 2 * numbers.units[self.at + 1])
        count = min(max(math.floor(part * n + 0.5), 1), n)
        self.firsts[clip], self.counts[clip], self.at = self.at + 2, count, self.at + 2 + count
        if last - first < n:
            own = slice(clip, clip + 1)
            is_hidden = hidden_codes(numbers.raw, self.firsts[own], self.n_codes[own], self.counts[own])
            count = max(1, int(is_hidden[first:last].sum()))
        self.at = questions(numbers.units, self.at, count, self.share, self.asked)


def questions(drawn, at, n, share, asked):
    """Adds the places of `n` questions from `at` on to `asked`; where their numbers end."""
    if share == 0:
        asked.extend(range(at, at + n))
        return at + n
    for _ in range(n):
        asked.append(at)
        at += 2 if drawn[at] < share else 1
    return at


def targets_of(is_hidden, n_codes, parts):
    """The hidden codes of the parts that are supervised; of a part without one its first code."""
    clip, place = spans(n_codes)
    is_target = is_hidden & (place >= parts.first[clip]) & (place < parts.last[clip])
    without = np.bincount(clip, is_target, len(n_codes)) == 0
    starts = np.cumsum(n_codes) - n_codes
    is_target[(starts + parts.first)[without]] = True
    return is_target


def hidden_codes(raw, firsts, n_codes, counts):
    """Whether each code of clips is among the `counts` of `n_codes` that are drawn for its clip, each once,
    by the numbers from `firsts` on: Fisher and Yates, clip beside clip."""
    most = int(n_codes.max())
    order = np.tile(np.arange(most), (len(n_codes), 1))
    for i in range(int(counts.max())):
        clip = np.flatnonzero(counts > i)
        other = i + each_below(raw[firsts[clip] + i], n_codes[clip] - i)
        order[clip, i], order[clip, other] = order[clip, other], order[clip, i].copy()
    is_hidden = np.zeros_like(order, bool)
    clip, place = spans(counts)
    is_hidden[clip, order[clip, place]] = True
    return is_hidden[np.arange(most) < n_codes[:, None]]
