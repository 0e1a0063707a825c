"""Quantizers: what lies between the halves of a tokenizer.

Shapes: b clips, t latents, s codes of a clip on a scale, c channels, n = b·t rows.
"""

from functools import cache

import numpy as np
import torch
from torch import nn

from .codebook import Fsq, Vq, exact_product, straight_through
from .layers import Conv


def quantizer(spec):
    """The quantizer of a tokenizer, by the name of its kind."""
    own, keys = spec.quantizer, iter(spec.codebook_keys)
    if own["kind"] == "multiscale":
        return nn.ModuleDict({"Multiscale": Multiscale(own, spec, keys)})
    return codebook(own, spec, keys)


def codebook(own, spec, keys, cosine=False):
    """A codebook by the name of its kind."""
    if own["kind"] == "fsq":
        return nn.ModuleDict({"Fsq": Fsq(own["levels"], spec.code_dim)})
    return nn.ModuleDict({"Vq": Vq(own["n_vocab"], spec.code_dim, spec.training, next(keys), cosine)})


def only(named):
    """The one module of a dictionary."""
    (module,) = named.values()
    return module


def quantized(named, latents):
    """What the decoder sees of latents `[b, t, c]`, and the quantizer's own loss or None."""
    own = only(named)
    if isinstance(own, Multiscale):
        return own(latents)
    rows, loss = own.step(latents.flatten(0, 1))
    return rows.view_as(latents), loss


def codebooks(named):
    """The codebooks of VQ, those of all scales."""
    return [module for module in named.modules() if isinstance(module, Vq)]


class Smoothing(nn.Module):
    """What a scale makes of its codes' embeddings before it adds them: two convolutions (LG-Tok), or a share
    of one (VAR)."""

    def __init__(self, mix, code_dim):
        super().__init__()
        n = 2 if mix is None else 1
        self.convolutions = nn.ModuleList(Conv(code_dim, code_dim, rectify=i == 1) for i in range(n))
        self.mix = mix

    def forward(self, x):
        y = x
        for convolution in self.convolutions:
            y = convolution.along(y)
        return y.relu() if self.mix is None else x * (1.0 - self.mix) + y * self.mix


class Multiscale(nn.Module):
    """Residual quantization in which each scale sees the clip at its own length (VAR, LG-Tok)."""

    def __init__(self, own, spec, keys):
        super().__init__()
        made = [codebook(each, spec, keys, own["cosine"]) for each in own["codebooks"]]
        self.codebooks = nn.ModuleList(made)
        self.smoothings = nn.ModuleList(Smoothing(own["mix"], spec.code_dim) for _ in own["scales"])
        self.scales, self.beta, self.commitment = own["scales"], own["beta"], spec.training["commitment"]

    def forward(self, latents):
        plain, t = latents.detach(), latents.shape[1]
        rest, total, loss = plain, torch.zeros_like(plain), 0.0
        for own, smoothing, s in zip(map(only, self.codebooks), self.smoothings, self.scales):
            own.place(plain.flatten(0, 1))
            short = along_time(rest, area_weights, s)
            codes = own.embedded(short.flatten(0, 1)).view_as(short)
            added = smoothing(along_time(codes, linear_weights, t))
            own.follow(rest.flatten(0, 1))
            rest, total = rest - added.detach(), total + added
            loss = loss + (latents - total.detach()).square().mean() * self.beta + (total - plain).square().mean()
        return straight_through(total.detach(), latents), loss * (self.commitment / len(self.scales))


def along_time(x, weights, to):
    """`[b, from, c]` to `[b, to, c]` by a linear map; a length that stays changes nothing."""
    if x.shape[1] == to:
        return x
    return exact_product(weights(to, x.shape[1], x.device), x)


@cache
def area_weights(to, length, device):
    """Latent i is the mean of those from i·T/s down to (i + 1)·T/s up."""
    weights = np.zeros((to, length), np.float32)
    for i in range(to):
        first, last = i * length // to, -(-(i + 1) * length // to)
        weights[i, first:last] = 1.0 / (last - first)
    return torch.from_numpy(weights).to(device)


@cache
def linear_weights(to, length, device):
    """Latent i lies at (i + 1/2)·s/t - 1/2 on the line through the latents around it, at least at 0."""
    weights = np.zeros((to, length), np.float32)
    for i in range(to):
        place = max((i + 0.5) * length / to - 0.5, 0.0)
        left, share = int(place), np.float32(place - int(place))
        weights[i, left] += np.float32(1.0) - share
        weights[i, min(left + 1, length - 1)] += share
    return torch.from_numpy(weights).to(device)
