"""What the scales of a clip are shown of the scales before them: sums of what the tokenizer's quantizer makes
of their codes, each at the length of the scale that is shown it (VAR, LG-Tok).

Shapes: b clips, t latents of the longest clip, s codes of a clip on a scale, c channels.
"""

import json
import os

import numpy as np
import torch
import torch.nn.functional as F
from safetensors import safe_open
from torch import nn

from .network import product
from .packing import spans


def scale_inputs(folder, codes, stride):
    """The inputs of the scales of a tokenizer; None if it has one scale. Clips are measured in strides of frames."""
    if len(codes.scales) == 1:
        return None
    with open(os.path.join(folder, "tokenizer.json")) as file:
        tokenizer = json.load(file)
    quantizer, architecture = tokenizer["quantizer"], tokenizer["architecture"]
    kinds = {"multiscale": Multiscale, "residual": Residual}
    if quantizer["kind"] not in kinds:
        raise SystemExit(f"the torch trainer does not know the quantizer `{quantizer['kind']}`")
    strides = max(int(frames.max(initial=0)) for frames in codes.frames.values()) // stride
    with safe_open(os.path.join(folder, "weights.safetensors"), "pt") as file:
        return kinds[quantizer["kind"]](quantizer, Weights(file, "quantizer"), architecture, strides)


def latents_of(architecture, strides):
    """The latents of clips: one a stride, or as many for each piece of a clip."""
    if "latents" not in architecture:
        return strides
    pieces = -(-strides // (architecture["span"] // architecture["frames"]))
    return pieces * architecture["latents"]


class Weights:
    """The tensors of a file whose names begin alike."""

    def __init__(self, file, name):
        self.file, self.name = file, name

    def __getitem__(self, name):
        return Weights(self.file, f"{self.name}.{name}")

    def __call__(self, name):
        return self.file.get_tensor(f"{self.name}.{name}")

    def affine(self):
        return self("weight"), self("bias")


def digits(levels):
    """The digits of each code of FSQ, the first dimension the fastest, `[V, d]`."""
    ids = np.arange(int(np.prod(levels)))
    base = np.cumprod([1, *levels[:-1]])
    return torch.from_numpy(ids[:, None] // base % levels).float()


def codebook_rows(spec, weights):
    """The embedding of each code of a codebook, `[V, c]`."""
    if spec["kind"] == "vq":
        return weights["Vq"]("codebook")
    weight, bias = weights["Fsq"]["project_out"].affine()
    middle = torch.tensor(spec["levels"]) // 2
    return (digits(spec["levels"]) - middle) / middle @ weight + bias


class Multiscale(nn.Module):
    """Scales of fixed lengths: phi of the codes brought to the clip's latents, summed, and brought to the
    length of the next scale.

    A clip's sums stand side by side with those of longer clips; what lies after its last latent is 0
    where a convolution reads it, and has no weight in what is made of the sums.
    """

    def __init__(self, spec, weights, architecture, strides):
        super().__init__()
        own, latents = weights["Multiscale"], latents_of(architecture, strides)
        self.architecture, self.latents = architecture, latents
        self.scales, self.mix = spec["scales"], spec["mix"]
        rows = [codebook_rows(book, own["codebooks"][str(n)]) for n, book in enumerate(spec["codebooks"])]
        self.register_buffer("rows", torch.cat(rows), persistent=False)
        convolutions = 2 if self.mix is None else 1
        for n, (scale, later) in enumerate(zip(self.scales, self.scales[1:])):
            smoothing = own["smoothings"][str(n)]["convolutions"]
            for i in range(convolutions):
                weight, bias = smoothing[str(i)]["affine"].affine()
                self.register_buffer(f"weight_{n}_{i}", weight, persistent=False)
                self.register_buffer(f"bias_{n}_{i}", bias, persistent=False)
            up, down = tables(latents, linear_up, scale), tables(latents, area_down, later)
            self.register_buffer(f"up_{n}", up, persistent=False)
            self.register_buffer(f"down_{n}", down, persistent=False)

    def shown(self, first_row, strides):
        """The group of a batch that the inputs are made of: a clip's first row of codes, and its latents."""
        return {"shown_first": first_row, "shown_latents": latents_of(self.architecture, strides)}

    def at(self, _strides, clip, scale, slot):
        """Where the inputs of codes of later scales stand."""
        starts = np.cumsum([0, *self.scales]) - self.scales[0]
        return clip * (sum(self.scales) - self.scales[0]) + starts[scale] + slot

    def forward(self, ids, first, latents, dtype):
        """Inputs of all later scales of all clips, `[b s, c]`, from the codes of the rows of a batch, which
        count from the first scale's on."""
        within = torch.arange(sum(self.scales[:-1]), device=ids.device)
        codes = self.rows[ids[first[:, None] + within]]
        real = (torch.arange(self.latents, device=ids.device) < latents[:, None])[..., None]
        total, found = 0.0, []
        for n, own in enumerate(codes.split(self.scales[:-1], 1)):
            longer = getattr(self, f"up_{n}")[latents] @ own
            total = total + self._smoothed(n, longer, real, dtype)
            found.append(getattr(self, f"down_{n}")[latents] @ total)
        return torch.cat(found, 1).flatten(0, 1)

    def _smoothed(self, n, x, real, dtype):
        """phi of what a scale adds, `[b, t, c]`."""
        if self.mix is not None:
            return x * (1 - self.mix) + self._convolved(n, 0, x, dtype) * self.mix
        hidden = F.relu(self._convolved(n, 0, x, dtype)) * real
        return F.relu(self._convolved(n, 1, hidden, dtype))

    def _convolved(self, n, i, x, dtype):
        """Kernel 3 over latents, the earliest tap first."""
        taps = torch.cat([F.pad(x, (0, 0, 1, 0))[:, :-1], x, F.pad(x, (0, 0, 0, 1))[:, 1:]], -1)
        weight, bias = getattr(self, f"weight_{n}_{i}"), getattr(self, f"bias_{n}_{i}")
        return product(taps, weight, dtype).float() + bias


class Residual(nn.Module):
    """Layers of one length, a code of each for a latent: the sum of the layers before."""

    def __init__(self, spec, weights, _architecture, _strides):
        super().__init__()
        layers, book = range(spec["layers"]), spec["codebook"]
        self.n_layers, self.out = spec["layers"], book["kind"] == "fsq"
        if self.out:
            weight, bias = weights["ResidualFsq"]["project_out"].affine()
            self.register_buffer("weight", weight, persistent=False)
            self.register_buffer("bias", bias, persistent=False)
            base = torch.tensor(book["levels"]).float()
            rows = [((digits(book["levels"]) * 2 + 1) / base - 1) / base**i for i in layers]
        else:
            rows = [weights["ResidualVq"]["layers"][str(i)]("codebook") for i in layers]
        self.register_buffer("rows", torch.cat(rows), persistent=False)

    def shown(self, first_row, latents):
        """The group of a batch that the inputs are made of: for each latent, the row of its first code, and
        how many rows its next one is further on."""
        clip, place = spans(latents)
        return {"shown_first": first_row[clip] + place, "shown_latents": latents[clip]}

    def at(self, latents, clip, scale, slot):
        """Where the inputs of codes of later layers stand."""
        starts = np.cumsum(latents) - latents
        return (starts[clip] + slot) * (self.n_layers - 1) + scale - 1

    def forward(self, ids, first, latents, _dtype):
        """Inputs of all later layers of all latents, `[b s, c]`."""
        total, found = 0.0, []
        for layer in range(self.n_layers - 1):
            total = total + self.rows[ids[first + layer * latents]]
            found.append(total @ self.weight + self.bias if self.out else total)
        return torch.stack(found, 1).flatten(0, 1)


def tables(latents, weights, scale):
    """A map between the latents of a clip and a scale, for clips of each length up to `latents`; latents
    stand in the longest clip's places, `[latents + 1, to, from]`."""
    down = weights is area_down
    shape = (scale, latents) if down else (latents, scale)
    table = np.zeros((latents + 1, *shape), np.float32)
    for t in range(1, latents + 1):
        own = weights(scale, t) if down else weights(t, scale)
        table[t, : own.shape[0], : own.shape[1]] = own
    return torch.from_numpy(table)


def area_down(to, n):
    """Latent i is the mean of floor(i n / to)..ceil((i + 1) n / to), `[to, n]`."""
    i = np.arange(to)[:, None]
    place, first, last = np.arange(n), i * n // to, -(-(i + 1) * n // to)
    share = np.float32(1) / (last - first).astype(np.float32)
    return np.where((place >= first) & (place < last), share, np.float32(0))


def linear_up(to, n):
    """Latent i lies at (i + 1/2) n / to - 1/2 on the line through the latents around it, `[to, n]`."""
    if to == n:
        return np.eye(n, dtype=np.float32)
    place = np.maximum((np.arange(to) + 0.5) * n / to - 0.5, 0.0)
    left = place.astype(np.int64)
    share, table = (place - left).astype(np.float32), np.zeros((to, n), np.float32)
    table[np.arange(to), left] += np.float32(1) - share
    table[np.arange(to), np.minimum(left + 1, n - 1)] += share
    return table
