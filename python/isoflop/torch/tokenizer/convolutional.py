"""The convolutional autoencoder of T2M-GPT, which ScaMo keeps.

Shapes: b clips, t frames, f features, c channels; s = 2^down frames a latent.
"""

from torch import nn

from .layers import Conv

DILATION_GROWTH = 3


class Block(nn.Module):
    """x + conv1(relu(conv3(relu(x)))), with the dilation in the first convolution."""

    def __init__(self, width, dilation):
        super().__init__()
        self.dilated = Conv(width, width, dilation=dilation, rectify=True)
        self.point = Conv(width, width, "point", rectify=True)

    def forward(self, x):
        return x + self.point(self.dilated(x))


def blocks(width, depth):
    """The largest dilation first."""
    return nn.ModuleList(Block(width, DILATION_GROWTH**i) for i in reversed(range(depth)))


class DownStage(nn.Module):
    """A halving, then blocks."""

    def __init__(self, width, depth):
        super().__init__()
        self.halving, self.blocks = Conv(width, width, "halving"), blocks(width, depth)

    def forward(self, x):
        x = self.halving(x)
        for block in self.blocks:
            x = block(x)
        return x


class UpStage(nn.Module):
    """Blocks, then nearest upsampling and a convolution."""

    def __init__(self, width, depth):
        super().__init__()
        self.blocks, self.smoothing = blocks(width, depth), Conv(width, width, "doubling")

    def forward(self, x):
        for block in self.blocks:
            x = block(x)
        return self.smoothing(x)


class Encoder(nn.Module):
    """`[b, t, f]` to `[b, t/s, c]`."""

    def __init__(self, sizes, n_features):
        super().__init__()
        w, depth = sizes["width"], sizes["depth"]
        self.input, self.output = Conv(n_features, w), Conv(w, w)
        self.stages = nn.ModuleList(DownStage(w, depth) for _ in range(sizes["down"]))

    def forward(self, x, said, noise):
        x = self.input(x.transpose(1, 2)).relu()
        for stage in self.stages:
            x = stage(x)
        return self.output(x).transpose(1, 2)


class Decoder(nn.Module):
    """`[b, t/s, c]` to `[b, t, f]`."""

    def __init__(self, sizes, n_features):
        super().__init__()
        w, depth = sizes["width"], sizes["depth"]
        self.input, self.hidden = Conv(w, w), Conv(w, w)
        self.output = Conv(w, n_features, rectify=True)
        self.stages = nn.ModuleList(UpStage(w, depth) for _ in range(sizes["down"]))

    def forward(self, latents, _n_frames, said, noise):
        x = self.input(latents.transpose(1, 2)).relu()
        for stage in self.stages:
            x = stage(x)
        return self.output(self.hidden(x)).transpose(1, 2)
