"""The transformer of LG-Tok: latents that look at frames and words, and frames that look at latents and words.

Rows of a clip are its latents, its frames, then its words, which are padded to as many in all clips. Shapes:
b clips, t latents, f frames, m words, d width, h heads.
"""

import torch
import torch.nn.functional as F
from torch import nn

from .layers import Conv, Linear, Norm, empty

ROPE_BASE = 100.0
# Weights of a feed-forward layer, as a multiple of the width's square.
FFN_WEIGHTS = 12
# The root and the joints' positions: the features that the encoder sees.
N_SEEN = 67


class Said:
    """The captions of a batch: vectors `[b, m, dim]`, and how many words each clip has, `[b]`."""

    def __init__(self, vectors, words):
        self.vectors, self.words = vectors, words


def most_latents(sizes):
    """Latents of the longest window."""
    return sizes.get("latents") or sizes["span"] // sizes["frames"]


class Places(nn.Module):
    """The angles of latents, frames and words on the rotary index, `[2, n, c / 2]` of each; where a window of any length
    has as many latents, those of latents for each length, `[strides, 2, n, c / 2]`."""

    def __init__(self, sizes, sees_text):
        super().__init__()
        self.c = sizes["width"] // sizes["heads"]
        self.frames_each, self.fixed = sizes["frames"], "latents" in sizes
        most = most_latents(sizes)
        words = sizes["language"]["max_tokens"] if sees_text else 0
        latents, before = torch.arange(most, dtype=torch.float64), words + most
        if sizes["positions"] == "rotary":
            latents, before = self._middles(latents + 0.5, sizes["span"] // sizes["frames"]), words
        elif self.fixed:
            latents = latents.expand(sizes["span"] // sizes["frames"], -1)
        all_frames = torch.arange(sizes["span"], dtype=torch.float64)
        self._turn("latents", words + latents)
        self._turn("frames", before + all_frames)
        self._turn("words", torch.arange(max(1, words)))

    def _middles(self, latents, strides):
        """The middles of the latents' spans; of as many in any window, for windows of 1, 2, ... strides."""
        if not self.fixed:
            return latents * self.frames_each - 0.5
        frames = torch.arange(1, strides + 1, dtype=torch.float64)[:, None] * self.frames_each
        return latents * (frames / len(latents)) - 0.5

    def _turn(self, name, places):
        """Cosines and sines of places, `[..., 2, n, c / 2]`, computed in double precision."""
        rates = ROPE_BASE ** (-2.0 * torch.arange(self.c // 2, dtype=torch.float64) / self.c)
        angles = places.double()[..., None] * rates
        turns = torch.stack([angles.cos(), angles.sin()], -3).float()
        self.register_buffer(name, turns, persistent=False)

    def of_latents(self, n_frames):
        """The angles of the latents of a window, `[2, n, c / 2]`."""
        strides = n_frames // self.frames_each
        return self.latents[strides - 1] if self.fixed else self.latents[:, :strides]


def turned(x, turns):
    """Rotary position embedding of interleaved pairs, `[b, h, n, c]`; no turn at all without."""
    if turns is None:
        return x
    a, b = x.unflatten(-1, (-1, 2)).unbind(-1)
    cos, sin = turns
    return torch.stack([a * cos - b * sin, a * sin + b * cos], -1).flatten(-2)


def attended(heads, q, k, v, there, q_turns, k_turns):
    """`[b, n, d]` queries to keys and values of which `there` `[b, m]` says which are there; None for all."""
    q, k, v = (x.unflatten(-1, (heads, -1)).transpose(1, 2) for x in (q, k, v))
    mask = None if there is None else there[:, None, None, :]
    mixed = F.scaled_dot_product_attention(turned(q, q_turns), turned(k, k_turns), v, attn_mask=mask)
    return mixed.transpose(1, 2).flatten(-2)


class SelfAttention(nn.Module):
    def __init__(self, width, heads):
        super().__init__()
        self.qkv, self.output, self.heads = Linear(width, 3 * width), Linear(width, width), heads

    def forward(self, x, rows):
        q, k, v = self.qkv(x).chunk(3, -1)
        return self.output(attended(self.heads, q, k, v, rows.there, rows.turns, rows.turns))


class CrossAttention(nn.Module):
    def __init__(self, width, heads):
        super().__init__()
        self.query, self.key_value = Linear(width, width), Linear(width, 2 * width)
        self.output, self.heads = Linear(width, width), heads

    def forward(self, x, memory):
        k, v = self.key_value(memory.rows).chunk(2, -1)
        q_turns, k_turns = memory.turns
        return self.output(attended(self.heads, self.query(x), k, v, memory.there, q_turns, k_turns))


class Rows:
    """What rows see of one another: which are there, `[b, n]` or None for all, and their angles."""

    def __init__(self, there, turns):
        self.there, self.turns = there, turns


class Memory:
    """Rows that frames look at, which of them are there, and the angles of frames and rows."""

    def __init__(self, rows, there=None, turns=(None, None)):
        self.rows, self.there, self.turns = rows, there, turns


class FeedForward(nn.Module):
    """SwiGLU or GELU with biases, of as many weights."""

    def __init__(self, width, ffn):
        super().__init__()
        self.gated = ffn == "swiglu"
        hidden = FFN_WEIGHTS // (3 if self.gated else 2) * width
        self.up, self.down = Linear(width, 2 * hidden if self.gated else hidden), Linear(hidden, width)

    def forward(self, x):
        if not self.gated:
            return self.down(F.gelu(self.up(x)))
        gate, up = self.up(x).chunk(2, -1)
        return self.down(F.silu(gate) * up)


class Cross(nn.Module):
    def __init__(self, norm, width, heads):
        super().__init__()
        self.norm, self.attention = norm, CrossAttention(width, heads)


def norm_of(sizes):
    return Norm(sizes["width"], sizes["norm"] == "layer")


class Layer(nn.Module):
    """Attention of the rows to one another, to the latents, to the text, then the feed-forward layer."""

    def __init__(self, sizes, crossing):
        super().__init__()
        width, heads = sizes["width"], sizes["heads"]
        self.norm_attention, self.attention = norm_of(sizes), SelfAttention(width, heads)
        for name in crossing:
            setattr(self, name, Cross(norm_of(sizes), width, heads))
        self.norm_ffn, self.ffn = norm_of(sizes), FeedForward(width, sizes.get("ffn", "swiglu"))
        self.crossing, self.post, self.dropout = crossing, sizes["norm"] != "pre", sizes["dropout"]

    def forward(self, x, rows, memories, noise):
        x = self.add(x, self.norm_attention, lambda x: self.attention(x, rows), rows, noise)
        for name in self.crossing:
            cross = getattr(self, name)
            x = self.add(x, cross.norm, lambda x: cross.attention(x, memories[name]), rows, noise)
        return self.add(x, self.norm_ffn, self.ffn, rows, noise)

    def add(self, x, norm, part, rows, noise):
        if self.post:
            return norm(x + noise.drop(part(x), self.dropout, rows.there))
        return x + noise.drop(part(norm(x)), self.dropout, rows.there)


class Layers(nn.Module):
    """Layers between two norms, with skips a U: what those before the middle one give goes into those after it."""

    def __init__(self, sizes, crossing=()):
        super().__init__()
        width, n = sizes["width"], sizes["layers"]
        self.first_norm, self.last_norm = norm_of(sizes), norm_of(sizes)
        self.layers = nn.ModuleList(Layer(sizes, crossing) for _ in range(n))
        self.joins = nn.ModuleList(Linear(2 * width, width) for _ in range(n // 2 * sizes.get("skips", True)))

    def forward(self, x, rows, memories, noise):
        half, given, x = len(self.layers) // 2, [], self.first_norm(x)
        for i, layer in enumerate(self.layers):
            if i > half and self.joins:
                x = self.joins[i - half - 1](torch.cat([x, given.pop()], -1))
            x = layer(x, rows, memories, noise)
            if i < half:
                given.append(x)
        return self.last_norm(x)


def is_there(n, words, most):
    """Of `n` rows that are always there and `most` words, which are: `[b, n + most]`."""
    place = torch.arange(n + most, device=words.device)
    return place[None] < n + words[:, None]


def sees(sizes, half):
    return half in (sizes.get("language") or {"at": []})["at"]


class Encoder(nn.Module):
    """`[b, f, features]` to `[b, t, c]`."""

    def __init__(self, sizes, n_features):
        super().__init__()
        width, self.n_seen = sizes["width"], min(N_SEEN, n_features)
        self.motion, self.latents = Linear(self.n_seen, width), empty(most_latents(sizes), width)
        self.text = Linear(sizes["language"]["dim"], width) if sees(sizes, "tokenizer") else None
        self.layers, self.output = Layers(sizes), Conv(width, sizes["latent"])
        self.places = Places(sizes, self.text is not None)

    def forward(self, x, said, noise):
        b, f = x.shape[:2]
        turns, there = [self.places.of_latents(f), self.places.frames[:, :f]], None
        t = turns[0].shape[1]
        rows = [self.latents[:t].expand(b, t, -1), self.motion(x[..., : self.n_seen])]
        if self.text is not None:
            m = said.vectors.shape[1]
            rows.append(self.text(said.vectors))
            turns.append(self.places.words[:, :m])
            there = is_there(t + f, said.words, m)
        rows = self.layers(torch.cat(rows, 1), Rows(there, torch.cat(turns, 1)), {}, noise)
        return self.output.along(rows[:, :t])


class Decoder(nn.Module):
    """`[b, t, c]` to `[b, f, features]`."""

    def __init__(self, sizes, n_features):
        super().__init__()
        width = sizes["width"]
        self.input, self.mask = Conv(sizes["latent"], width), empty(1, width)
        self.rotary, self.crosses = sizes["positions"] == "rotary", sizes["detokenizer"] == "cross"
        if not self.rotary:
            self.frame_positions = empty(sizes["span"], width)
            self.latent_positions = empty(most_latents(sizes), width)
        self.text = Linear(sizes["language"]["dim"], width) if sees(sizes, "detokenizer") else None
        parts = ("latents", "text") if self.text is not None else ("latents",)
        self.layers = Layers(sizes, parts if self.crosses else ())
        self.output = Linear(width, n_features)
        self.places = Places(sizes, self.text is not None)

    def forward(self, latents, f, said, noise):
        b, t, _ = latents.shape
        latents, frames = self.input.along(latents), self.mask.expand(f, -1)
        if not self.rotary:
            latents, frames = latents + self.latent_positions[:t], frames + self.frame_positions[:f]
        frames = frames.expand(b, f, -1)
        words, there = self.words(said) if self.text is not None else (None, None)
        turns = self.places.frames[:, :f], self.places.of_latents(f)
        if self.crosses:
            memories = {"latents": Memory(latents, turns=turns if self.rotary else (None, None))}
            memories["text"] = Memory(words, there)
            return self.output(self.layers(frames, Rows(None, turns[0]), memories, noise))
        rows, all_turns = [latents, frames], [turns[1], turns[0]]
        if words is not None:
            rows.append(words)
            all_turns.append(self.places.words[:, : words.shape[1]])
            always = torch.ones(b, t + f, dtype=torch.bool, device=words.device)
            there = torch.cat([always, there], 1)
        rows = self.layers(torch.cat(rows, 1), Rows(there, torch.cat(all_turns, 1)), {}, noise)
        return self.output(rows[:, t : t + f])

    def words(self, said):
        """The captions' words, and which are there; the mask's vector alone stands for a caption that is left
        out."""
        words = self.text(said.vectors)
        first = torch.where((said.words == 0)[:, None], self.mask, words[:, 0])
        words = torch.cat([first[:, None], words[:, 1:]], 1)
        return words, is_there(0, said.words.clamp(min=1), words.shape[1])
