"""The windows of each step: pure functions of the seed, so that the built-in trainer's are the same.

Shapes: b windows, t frames, f features.
"""

import numpy as np
import torch
from safetensors import safe_open

from ..chacha import Stream, each_below, units

WINDOWS_STREAM = 1
CAPTIONS_STREAMS = 1 << 40
# Steps whose numbers are drawn at once.
AT_ONCE = 64


def numbers_from(stream, first, n):
    """The numbers `first..first + n` of a stream that nothing was taken of."""
    stream.block = first // 8
    stream.take(first % 8)
    return stream.take(n)


class Pool:
    """The clips of the training split, normalised; their frames lie on the device."""

    def __init__(self, path, device):
        with safe_open(path, "pt") as file:
            self.offsets = file.get_tensor("offsets").view(torch.int64).numpy()
            self.origins = file.get_tensor("origins").view(torch.int64).numpy()
            self.mean, self.std = file.get_tensor("mean").to(device), file.get_tensor("std").to(device)
            self.values = file.get_tensor("values").view(-1, len(self.mean)).to(device)
            self.long_from = int(file.get_tensor("long_from").view(torch.int64))
        self.frames = np.diff(self.offsets)


class Windows:
    """Random windows of clips: of each clip as many, or, if some are shorter than a window, by their frames. Where long
    clips make half of a step's windows, these are the first ones."""

    def __init__(self, spec, pool, device):
        self.spec, self.pool, self.device = spec, pool, device
        self.batch, self.stride = spec.training["batch"], spec.stride
        self.least, self.most = spec.shortest_window(), spec.training["window"] // self.stride
        self.per_step = 2 * self.batch + int(spec.is_transformer)
        self.first, self.drawn = 0, np.empty((0, self.per_step), np.uint64)

    def _numbers(self, step):
        """The numbers of a step."""
        if not self.first <= step < self.first + len(self.drawn):
            stream = Stream(self.spec.seed, WINDOWS_STREAM)
            before = self.spec.drawn + step * self.per_step
            drawn = numbers_from(stream, before, AT_ONCE * self.per_step)
            self.first, self.drawn = step, drawn.reshape(AT_ONCE, self.per_step)
        return self.drawn[step - self.first]

    def chosen(self, step):
        """Of each window its clip in the pool and its first frame there; and the frames of all of them."""
        numbers, n_frames = self._numbers(step), self.most * self.stride
        if self.spec.is_transformer:
            n_frames = (self.least + int(each_below(numbers[:1], self.most - self.least + 1)[0])) * self.stride
            numbers = numbers[1:]
        of_clip, of_start = numbers.reshape(self.batch, 2).T
        pool, n_clips = self.pool, len(self.pool.frames)
        is_long = (np.arange(self.batch) < self.batch // 2) & (pool.long_from < n_clips)
        first, end = np.where(is_long, pool.long_from, 0), np.where(is_long, n_clips, pool.long_from)
        if self.spec.by_joints:
            first, end = pool.offsets[first], pool.offsets[end]
            clips = np.searchsorted(pool.offsets[1:], first + each_below(of_clip, end - first), side="right")
        else:
            clips = first + each_below(of_clip, end - first)
        taken = np.minimum(self.pool.frames[clips], n_frames)
        return clips, each_below(of_start, self.pool.frames[clips] - taken + 1), n_frames

    def of(self, step):
        """The windows of a step, `[b, t, f]`; which frames are a clip's own, `[b, t]`, since where a clip has
        ended its last frame stands again; and the clips of the training split, `[b]`."""
        clips, starts, n_frames = self.chosen(step)
        taken = np.minimum(self.pool.frames[clips], n_frames)[:, None]
        place = np.arange(n_frames)[None]
        rows = (self.pool.offsets[clips] + starts)[:, None] + np.minimum(place, taken - 1)
        rows, visible = on_device(rows, self.device), on_device(place < taken, self.device)
        return self.pool.values[rows], visible, self.pool.origins[clips]


class CaptionsOfSteps:
    """The captions of a step's clips: one of each clip's, or none, as often as the spec says."""

    def __init__(self, spec, captions, device):
        self.spec, self.captions, self.device = spec, captions, device
        self.vectors = captions.vectors.to(device)

    def of(self, step, clips):
        """Vectors `[b, words, dim]`, and how many words each has `[b]`."""
        stream = Stream(self.spec.seed, CAPTIONS_STREAMS + step)
        of_caption, of_drop = stream.take(2 * len(clips)).reshape(-1, 2).T
        offsets, captions = self.captions.offsets["train"], self.captions.captions["train"]
        shown = captions[offsets[clips] + each_below(of_caption, np.diff(offsets)[clips])]
        words = np.where(units(of_drop) < self.spec.language["drop"], 0, self.captions.n_words[shown])
        most = self.spec.language["max_tokens"] if self.device.type == "cuda" else max(1, words.max())
        place = np.arange(most)[None]
        rows = self.captions.first_word[shown][:, None] + place
        rows = np.where(place < words[:, None], rows, len(self.captions.vectors) - 1)
        return self.vectors[on_device(rows, self.device)], on_device(words, self.device)


def on_device(array, device):
    tensor = torch.from_numpy(np.ascontiguousarray(array))
    return tensor.pin_memory().to(device, non_blocking=True) if device.type == "cuda" else tensor
