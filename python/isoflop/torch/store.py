"""What a run reads: the codes and the captions of a data set, as isoflop writes them."""

import json

import numpy as np
import torch
from safetensors import safe_open

SPLITS = ("train", "val", "test")


def columns(path):
    """The arrays of a safetensors file by name, mapped and not read, and its notes."""
    with safe_open(path, "pt") as file:
        return {name: file.get_tensor(name).numpy() for name in file.keys()}, file.metadata() or {}


class Scale:
    """A codebook of the grid: V codes, and how many of them a clip has."""

    def __init__(self, spec):
        self.n_vocab = spec["n_vocab"]
        ((self.rule, self.by),) = spec["length"].items()

    def codes(self, frames):
        """Codes of clips of so many frames (an array, or one)."""
        return frames // self.by if self.rule == "frames_per_code" else frames * 0 + self.by


class Codes:
    """The codes of all clips, scale after scale."""

    def __init__(self, path, grid):
        arrays, notes = columns(path)
        if json.loads(notes["grid"]) != grid:
            raise SystemExit(f"the codes in {path} are not those of the run: their grids differ")
        self.scales, self.end_token = [Scale(scale) for scale in grid["scales"]], grid["end_token"]
        self.n_vocab = sum(scale.n_vocab for scale in self.scales)
        self.frames = {name: arrays[f"{name}.frames"].astype(np.int64) for name in SPLITS}
        self.offsets = {name: arrays[f"{name}.offsets"].astype(np.int64) for name in SPLITS}
        self.codes = {name: arrays[f"{name}.codes"].astype(np.int64) for name in SPLITS}

    def n_clips(self, split):
        return len(self.frames[split])

    def lengths(self, split):
        """Codes of each clip on each scale, `[n_clips, n_scales]`."""
        frames = self.frames[split]
        return np.stack([scale.codes(frames) for scale in self.scales], 1)

    def n_targets(self, split):
        """What a model predicts of each clip: its codes, and the end token if there is one."""
        return np.diff(self.offsets[split]) + int(self.end_token)

    def starts(self):
        """The codes of the codebooks before each scale's, `[n_scales]`: scales as one vocabulary."""
        sizes = [scale.n_vocab for scale in self.scales]
        return np.cumsum([0, *sizes[:-1]])

    def scale_of_code(self, split):
        """The scale of each code of a split."""
        lengths = self.lengths(split)
        return np.repeat(np.tile(np.arange(len(self.scales)), len(lengths)), lengths.ravel())

    def stream(self, split):
        """All codes of a split as ids of one vocabulary, clip after clip."""
        return self.codes[split] + self.starts()[self.scale_of_code(split)]

    def unigram(self):
        """-ln p of each id of `stream` and, last, of the end token, `[V + 1]`: (count + 1) / (total + V + 1)
        on the training split, each scale by itself (ScaMo section 4.4)."""
        ids, nll = self.stream("train"), []
        ends = self.n_clips("train") if self.end_token else 0
        for first, scale in zip(self.starts(), self.scales):
            own = ids[(ids >= first) & (ids < first + scale.n_vocab)] - first
            counts = np.append(np.bincount(own, minlength=scale.n_vocab), ends)
            nll.append(np.log(counts.sum() + scale.n_vocab + 1) - np.log(counts + 1.0))
        return np.concatenate([*(own[:-1] for own in nll[:-1]), nll[-1]])


class Captions:
    """The vectors of all captions, word after word."""

    def __init__(self, path):
        arrays, notes = columns(path)
        self.dim = int(notes["dim"])
        # The last row is the caption that is left out, one vector of zeros.
        vectors = torch.from_numpy(arrays["embeddings"]).view(-1, self.dim)
        self.vectors = torch.cat([vectors, torch.zeros(1, self.dim)])
        self.first_word = arrays["words"].astype(np.int64)
        self.n_words = np.diff(self.first_word)
        self.captions = {name: arrays[f"{name}.captions"].astype(np.int64) for name in SPLITS}
        self.offsets = {name: arrays[f"{name}.offsets"].astype(np.int64) for name in SPLITS}

    def shown(self, split):
        """The caption of each clip of a split that is measured: clip i shows caption i mod n."""
        counts = np.diff(self.offsets[split])
        return self.captions[split][self.offsets[split][:-1] + np.arange(len(counts)) % counts]
