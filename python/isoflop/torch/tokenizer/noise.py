"""What a step drops, drawn as the built-in trainer draws it."""

import numpy as np
import torch
import torch.nn.functional as F

from ..chacha import Stream

NOISE_STREAMS = 2 << 40


class Noise:
    """Dropout of one step: from the step's own stream; on a GPU from the card's own numbers, which cost
    nothing."""

    def __init__(self, seed, step):
        self.stream, self.left = Stream(seed, NOISE_STREAMS + step), np.empty(0, np.uint16)

    def drop(self, x, rate, there):
        """Each value 0 with probability `rate`, else larger by 1 / (1 - rate); rows that are not there draw
        nothing."""
        if rate == 0.0:
            return x
        if x.is_cuda:
            return F.dropout(x, rate)
        shape = x.shape if there is None else (int(there.sum()), x.shape[-1])
        kept = self._numbers(int(np.prod(shape))) >= rate * (1 << 16)
        factors = torch.from_numpy(kept.astype(np.float32)) * np.float32(1.0 / (1.0 - rate))
        factors = factors.view(*shape)
        if there is not None:
            factors = torch.zeros_like(x).masked_scatter(there[..., None].expand(x.shape), factors)
        return x * factors

    def _numbers(self, n):
        """The next `n` numbers of sixteen bits."""
        missing = n - len(self.left)
        if missing > 0:
            self.left = np.concatenate([self.left, self.stream.take(-(-missing // 4)).view(np.uint16)])
        numbers, self.left = self.left[:n], self.left[n:]
        return numbers
