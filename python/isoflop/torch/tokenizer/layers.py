"""Layers with the names and shapes of the built-in trainer's: products are x W.

Shapes: b clips, t frames or rows, c channels, k taps.
"""

import torch
import torch.nn.functional as F
from torch import nn

EPSILON = 1e-5


def empty(*shape):
    """A parameter that the first weights will fill."""
    return nn.Parameter(torch.empty(shape))


class Linear(nn.Module):
    """x W + b."""

    def __init__(self, c_in, c_out):
        super().__init__()
        self.weight, self.bias = empty(c_in, c_out), empty(c_out)

    def forward(self, x):
        return x @ self.weight + self.bias


class Conv(nn.Module):
    """A convolution over frames with zeros beyond the clip, `[b, c, t]`; the weight is `[k·c_in, c_out]`, the
    earliest tap first. `kind` is `point`, `same` (as many frames), `halving` or `doubling`."""

    def __init__(self, c_in, c_out, kind="same", dilation=1, rectify=False):
        super().__init__()
        self.taps = {"point": 1, "same": 3, "halving": 4, "doubling": 3}[kind]
        self.affine = Linear(self.taps * c_in, c_out)
        self.kind, self.dilation, self.rectify = kind, dilation, rectify

    def forward(self, x):
        weight = self.affine.weight.unflatten(0, (self.taps, -1)).permute(2, 1, 0)
        x = x.relu() if self.rectify else x
        if self.kind == "doubling":
            x = x.repeat_interleave(2, -1)
        padding = 0 if self.kind == "point" else self.dilation
        stride = 2 if self.kind == "halving" else 1
        return F.conv1d(x, weight, self.affine.bias, stride, padding, self.dilation)

    def along(self, x):
        """The same of `[b, t, c]`."""
        return self(x.transpose(1, 2)).transpose(1, 2)


class Norm(nn.Module):
    """RMSNorm, or LayerNorm, which has a bias."""

    def __init__(self, width, centred):
        super().__init__()
        self.gain, self.bias = empty(width), empty(width) if centred else None

    def forward(self, x):
        if self.bias is not None:
            return F.layer_norm(x, x.shape[-1:], self.gain, self.bias, EPSILON)
        return x / (x.square().mean(-1, keepdim=True) + EPSILON).sqrt() * self.gain
