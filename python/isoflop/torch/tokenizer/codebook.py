"""Codebooks: latents to codes and back.

Shapes: n latents, c channels, v codes, d dimensions of FSQ.
"""

import math

import numpy as np
import torch
from torch import nn

from ..chacha import Stream, each_below, units
from .layers import Linear

# How far past the outermost level FSQ's bound reaches.
EPSILON = 1e-3
# The decay of the moving averages, and what one more latent counts for.
DECAY = np.float32(0.99)
SHARE = np.float32(1.0) - DECAY
# A code met less often than this, on average and per step, is placed anew by T2M-GPT's rule.
LEAST_COUNT = 1.0
# Distances that are held at once.
AT_ONCE = 1 << 27
SHORTEST = 1e-12


def straight_through(value, gradient):
    """A value with the gradient of another."""
    return value + (gradient - gradient.detach())


class Fsq(nn.Module):
    """Finite scalar quantization between two projections (Mentzer et al. 2023, as ScaMo's code has it)."""

    def __init__(self, levels, code_dim):
        super().__init__()
        self.project_in, self.project_out = Linear(code_dim, len(levels)), Linear(len(levels), code_dim)
        half = [(level - 1) * (1 + EPSILON) / 2 for level in levels]
        offset = [0.0 if level % 2 else 0.5 for level in levels]
        shift = [0.0 if level == 2 else math.atanh(o / h) for level, o, h in zip(levels, offset, half)]
        rows = {"reach": half, "offset": offset, "shift": shift, "middle": [level // 2 for level in levels]}
        for name, values in rows.items():
            self.register_buffer(name, torch.tensor(values, dtype=torch.float32), persistent=False)

    def embedded(self, latents):
        """The embedding of each latent's code, `[n, c]`, with a gradient through the rounding."""
        projected = exact_product(latents, self.project_in.weight) + self.project_in.bias
        bounded = (projected + self.shift).tanh() * self.reach - self.offset
        codes = straight_through(bounded.round().detach(), bounded) / self.middle
        return self.project_out(codes)

    def step(self, latents):
        """The same and the quantizer's own loss: none."""
        return self.embedded(latents), None

    def place(self, latents):
        """Nothing: its codes lie where they are."""

    def follow(self, latents):
        """Nothing: its codes do not move by averages."""


class Vq(nn.Module):
    """A codebook of moving averages and resets, as T2M-GPT trains it, without gradient."""

    def __init__(self, n_vocab, code_dim, training, key, cosine=False):
        super().__init__()
        self.commitment, self.reset_share, self.cosine = training["commitment"], training["reset_share"], cosine
        self.register_buffer("codebook", torch.zeros(n_vocab, code_dim))
        self.register_buffer("sums", torch.zeros(n_vocab, code_dim), persistent=False)
        self.register_buffer("counts", torch.ones(n_vocab), persistent=False)
        self.placed = False
        self.stream = Stream(0, 0)
        self.stream.key = key

    def embedded(self, latents):
        """The embedding of the nearest code of each latent."""
        return self.codebook[self.codes_of(latents)]

    def step(self, latents):
        """Embeddings with the latents' gradient, after which the codes move; and what draws latents to codes."""
        plain = latents.detach()
        self.place(plain)
        ids = self.codes_of(plain)
        embedded = self.codebook[ids]
        self.follow(plain, ids)
        commitment = (latents - embedded).square().mean() * self.commitment
        return straight_through(embedded, latents), commitment

    def codes_of(self, latents):
        """The nearest code of each latent: by place, or by direction."""
        codes = self.codebook
        if self.cosine:
            latents, codes = directions(latents), directions(codes)
        squares = codes.square().sum(1)
        some = latents.split(max(1, AT_ONCE // len(codes)))
        return torch.cat([(squares - 2.0 * exact_product(part, codes.T)).argmin(1) for part in some])

    def place(self, latents):
        """Puts the codes at the first latents of a batch, unless they are placed."""
        if not self.placed:
            self.placed = True
            self.sums.copy_(self._candidates(latents))
            self.codebook.copy_(self.sums)

    def follow(self, latents, ids=None):
        """Moves the codes after a batch of latents, each with the code that it takes."""
        ids = self.codes_of(latents) if ids is None else ids
        self.sums.mul_(float(DECAY)).index_add_(0, ids, latents * float(SHARE))
        self.counts.mul_(float(DECAY)).index_add_(0, ids, torch.full_like(latents[:, 0], float(SHARE)))
        if self.reset_share > 0.0:
            self._reset_by_shares(latents)
            self.codebook.copy_(self.sums / self.counts[:, None])
        else:
            is_met = (self.counts >= LEAST_COUNT)[:, None]
            self.codebook.copy_(torch.where(is_met, self.sums / self.counts[:, None], self._candidates(latents)))

    def _reset_by_shares(self, latents):
        """Places codes anew that are met by less than a share of the mean, as if met as often as the mean."""
        mean = len(latents) / len(self.counts)
        rare = self.counts < np.float32(self.reset_share) * np.float32(mean)
        if latents.is_cuda:
            chosen = torch.randint(len(latents), self.counts.shape, device=latents.device)
            self.sums.copy_(torch.where(rare[:, None], latents[chosen] * mean, self.sums))
        elif rare.any():
            chosen = each_below(self.stream.take(int(rare.sum())), len(latents))
            self.sums[rare] = latents[torch.from_numpy(chosen)] * mean
        self.counts.masked_fill_(rare, mean)

    def _candidates(self, latents):
        """One latent for each code: the batch's first ones, or, if it has too few, all of them over and over
        with some noise."""
        v, c = self.codebook.shape
        if len(latents) >= v:
            return latents[:v]
        repeated = latents.repeat(-(-v // len(latents)), 1)[:v]
        deviation = 0.01 / math.sqrt(c)
        if latents.is_cuda:
            return repeated + torch.randn_like(repeated) * deviation
        return repeated + torch.from_numpy(normals(self.stream, v * c, deviation)).view(v, c)

    def state(self):
        """What training goes on from beside the weights."""
        drawn = 8 * self.stream.block - len(self.stream.left)
        return {"sums": self.sums, "counts": self.counts, "placed": self.placed, "drawn": drawn}

    def resume(self, state):
        self.sums.copy_(state["sums"])
        self.counts.copy_(state["counts"])
        self.placed, self.stream.left = state["placed"], np.empty(0, np.uint64)
        self.stream.block = state["drawn"] // 8
        self.stream.take(state["drawn"] % 8)


def exact_product(a, b):
    """A product in single precision, on cards too that else round to fewer bits."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("highest")
    try:
        return a @ b
    finally:
        torch.set_float32_matmul_precision(before)


def directions(rows):
    """Rows of length 1; a row of zeros stays one."""
    return rows / rows.square().sum(1, keepdim=True).sqrt().clamp(min=SHORTEST)


def normals(stream, n, deviation):
    """Normal numbers, by pairs (Box and Muller)."""
    a, b = units(stream.take(2 * -(-n // 2))).reshape(-1, 2).T
    radius, angle = np.sqrt(-2.0 * np.log(1.0 - a)), 2.0 * np.pi * b
    pairs = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1) * deviation
    return pairs.reshape(-1)[:n].astype(np.float32)
