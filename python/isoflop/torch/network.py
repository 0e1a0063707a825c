"""The blocks that all generators share: pre-norm attention and feed-forward over packed rows.

Parameters have the built-in trainer's names and shapes, products are x W. Shapes: n rows, d width, h heads,
c features of a head, f width of the feed-forward layer.
"""

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import nn

from .packing import BLOCK

EPSILON = 1e-5
# Features of a head that flex attention takes, at least.
LEAST_HEAD = 16
# Logits that are held at once, at most.
LOGITS_AT_ONCE = 1 << 28


def product(x, weight, dtype):
    """x W; operands are rounded to `dtype`."""
    return x.to(dtype) @ weight.to(dtype)


def rms_norm(x, gamma):
    x = x.float()
    return x * torch.rsqrt(x.square().mean(-1, keepdim=True) + EPSILON) * gamma


def angles(positions, c, base):
    """Cosines and sines of positions, `[n, c / 2]`, computed in double precision."""
    rates = base ** (-2.0 * torch.arange(c // 2, dtype=torch.float64) / c)
    turned = torch.as_tensor(positions, dtype=torch.float64)[:, None] * rates
    return turned.cos().float(), turned.sin().float()


def turned(x, cos, sin):
    """Rotary position embedding, `[n, h, c]`: the first half of the features are the first of their pairs."""
    a, b = x.float().chunk(2, -1)
    cos, sin = cos[:, None], sin[:, None]
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1).to(x.dtype)


def halves(weight, heads, axis):
    """A weight whose features along `axis`, pairs after pairs in `heads` heads, come half after half: the
    built-in model turns pairs that lie side by side, and a GPU turns halves four times as fast."""
    pairs = weight.unflatten(axis, (heads, -1, 2))
    axis = axis % weight.dim()
    return pairs.transpose(axis + 1, axis + 2).flatten(axis, axis + 2)


class View(NamedTuple):
    """What the attention of a batch needs, but for queries, keys and values.

    `cos` and `sin` are the angles of each row, a row sees the rows `first <= k < last`. Of a batch as it is,
    `grid` and `grid_at` lay its rows out sequence by sequence. Of a padded one, `blocks` has for each block of
    rows how many blocks it looks at and which, and how many look at it and which.
    """

    cos: torch.Tensor
    sin: torch.Tensor
    first: torch.Tensor
    last: torch.Tensor
    grid: torch.Tensor | None
    grid_at: torch.Tensor | None
    blocks: tuple | None

    @classmethod
    def of(cls, batch, cos, sin):
        first, last, grid = batch["first"], batch["last"], batch.get("grid")
        blocks = looked_at(first, last) if grid is None else None
        at = batch["angle"]
        # A kernel compares short numbers faster.
        short = (first.to(torch.int32), last.to(torch.int32))
        return cls(cos[at], sin[at], *short, grid, batch.get("grid_at"), blocks)

    def attend(self, q, k, v):
        """`[n, h, c]` each to the same."""
        q, k = turned(q, self.cos, self.sin), turned(k, self.cos, self.sin)
        return self._sequences(q, k, v) if self.blocks is None else self._packed(q, k, v)

    def _packed(self, q, k, v):
        """Flex attention over all rows: a kernel that a GPU compiles."""
        from torch.nn.attention.flex_attention import BlockMask, flex_attention

        n, first, last = len(q), self.first, self.last

        def visible(_batch, _head, query, key):
            return (key >= first[query]) & (key < last[query])

        counts, order, counts_back, order_back = self.blocks
        none = (None, None)
        mask = BlockMask(
            (n, n), counts, order, *none, counts_back, order_back, *none, (BLOCK, BLOCK), visible
        )
        c = q.shape[-1]
        wider = (0, max(0, LEAST_HEAD - c))
        q, k, v = (F.pad(x, wider).transpose(0, 1)[None] for x in (q, k, v))
        mixed = flex_attention(q, k, v, block_mask=mask, scale=c**-0.5)
        return mixed[0].transpose(0, 1)[..., :c]

    def _sequences(self, q, k, v):
        """Sequence by sequence, padded to the longest: on a processor, and wherever nothing is compiled."""
        rows, key = self.grid.clamp(min=0), self.grid[:, None, :]
        sees = (key >= self.first[rows][:, :, None]) & (key < self.last[rows][:, :, None])
        q, k, v = (x[rows].transpose(1, 2) for x in (q, k, v))
        mixed = F.scaled_dot_product_attention(q, k, v, attn_mask=sees[:, None])
        return mixed.transpose(1, 2).flatten(0, 1)[self.grid_at]


def looked_at(first, last):
    """Of each block of rows, how many blocks it looks at and which, the same of those that look at it.

    Rows see intervals whose ends only grow from row to row, so blocks do too, both ways, and nothing is sorted.
    """
    n = len(first) // BLOCK
    low = first.view(n, BLOCK).amin(1) // BLOCK
    high = (last.view(n, BLOCK).amax(1) - 1) // BLOCK
    columns = torch.arange(n, dtype=first.dtype, device=first.device)
    seen_from = (high[None] < columns[:, None]).sum(1)
    seen_to = (low[None] <= columns[:, None]).sum(1) - 1
    found = []
    for a, b in ((low, high), (seen_from, seen_to)):
        which = (a[:, None] + columns).clamp(max=n - 1)
        found += [(b - a + 1)[None, None], which[None, None]]
    return tuple(own.to(torch.int32).contiguous() for own in found)


class Block(nn.Module):
    """x + Attention(RMSNorm(x)) W_o, then x + FFN(RMSNorm(x))."""

    def __init__(self, shape):
        super().__init__()
        d, f = shape["d_model"], shape["d_ff"]
        self.n_head, self.ffn = shape["n_head"], shape["ffn"]
        self.norm_attention, self.norm_ffn = empty(d), empty(d)
        self.qkv, self.output = empty(d, 3 * d), empty(d, d)
        self.up, self.down = empty(d, 2 * f if self.ffn == "swiglu" else f), empty(f, d)

    def forward(self, x, view, dtype):
        n, d = x.shape
        weight = halves(self.qkv, 3 * self.n_head, 1)
        qkv = product(rms_norm(x, self.norm_attention), weight, dtype)
        q, k, v = qkv.view(n, 3, self.n_head, d // self.n_head).unbind(1)
        weight = halves(self.output, self.n_head, 0)
        x = x + product(view.attend(q, k, v).reshape(n, d), weight, dtype)
        hidden = product(rms_norm(x, self.norm_ffn), self.up, dtype)
        if self.ffn == "swiglu":
            gate, up = hidden.chunk(2, -1)
            hidden = F.silu(gate) * up
        else:
            hidden = F.gelu(hidden)
        return x + product(hidden, self.down, dtype)


def empty(*shape):
    """A parameter that is filled from a file."""
    return nn.Parameter(torch.zeros(shape))


class Network(nn.Module):
    """What the models of all generators have: captions, blocks, the norm before a head.

    Frozen tensors (vectors of captions, angles) are buffers that no file holds.
    """

    # Methods that are compiled for training, beside blocks.
    PARTS = ("embedded", "head_loss")

    def __init__(self, shape, vectors, positions):
        super().__init__()
        d = shape["d_model"]
        # What products are computed in, and the parts of a step that are compiled, by name.
        self.dtype, self.compiled = torch.float32, {}
        self.text_weight, self.text_bias = empty(shape["d_text"], d), empty(d)
        self.blocks = nn.ModuleList(Block(shape) for _ in range(shape["n_layer"]))
        self.norm = empty(d)
        cos, sin = angles(positions, d // shape["n_head"], shape["rope_base"])
        for name, tensor in (("vectors", torch.as_tensor(vectors)), ("cos", cos), ("sin", sin)):
            self.register_buffer(name, tensor, persistent=False)

    def text(self, batch):
        """Projected words, `[n_words, d]`."""
        return product(self.vectors[batch["words"]], self.text_weight, self.dtype) + self.text_bias

    def compile_parts(self):
        """Compiles what a step consists of. A block is compiled once for all layers: a model of forty layers
        is ready as soon as one of four."""
        for block in self.blocks:
            block.compile(dynamic=False)
        self.compiled = {name: torch.compile(getattr(self, name), dynamic=False) for name in self.PARTS}

    def part(self, name):
        """A part of a step: compiled for training, as it is for measuring, where shapes vary."""
        own = getattr(self, name)
        return self.compiled.get(name, own) if torch.is_grad_enabled() else own

    def optional(self, batch):
        """Parameters that a batch may ask nothing of, each with whether it does."""
        return []

    def view(self, batch):
        return View.of(batch, self.cos, self.sin)

    def stacked(self, x, batch):
        """What the blocks make of all rows, `[n, d]`."""
        view = self.view(batch)
        for block in self.blocks:
            call = block if torch.is_grad_enabled() else block.forward
            x = call(x, view, self.dtype)
        return x

    def head_loss(self, x, head, targets, weights):
        """The weighted sum of -ln p of targets, `[s]`, of the rows that predict them, `[s, d]`; the head is
        `[d, V]`."""
        return HeadLoss.apply(rms_norm(x, self.norm).to(self.dtype), head, targets, weights)

    def head_nll(self, x, head, targets):
        """-ln p of each target, in nats, and the likeliest class in its place, `[s]` each, without gradients."""
        rows, weight = rms_norm(x, self.norm).to(self.dtype), widened(head, x)

        def found(own, asked):
            nll, _, logits = nll_and_total(own, weight, asked, head.shape[1])
            return nll, logits.argmax(1)

        return [torch.cat(parts) for parts in zip(*(found(*chunk) for chunk in chunks(weight, rows, targets)))]


def widened(head, x):
    """A head whose columns are whole tiles of a GPU's products: an odd V would halve their speed."""
    width = -(-head.shape[1] // 64) * 64 if x.is_cuda else head.shape[1]
    return F.pad(head, (0, width - head.shape[1]))


def chunks(weight, *tensors):
    """Tensors of equally many rows in chunks of rows with so many logits."""
    at_once = max(1, LOGITS_AT_ONCE // weight.shape[1])
    return zip(*(tensor.split(at_once) for tensor in tensors))


def nll_and_total(x, weight, targets, n_classes):
    """-ln p of targets, `[s]`, ln of the sum of all exponentials, `[s]`, and the logits, `[s, V]`."""
    logits = (x @ weight.to(x.dtype))[:, :n_classes].float()
    total = torch.logsumexp(logits, 1)
    return total - logits.gather(1, targets[:, None]).squeeze(1), total, logits


class HeadLoss(torch.autograd.Function):
    """The weighted sum of the cross-entropies of x W, in chunks of rows.

    Slopes are taken in the forward pass, so that no logits are kept and none are computed twice.
    """

    @staticmethod
    def forward(ctx, x, head, targets, weights):
        weight, n_classes = widened(head, x).to(x.dtype), head.shape[1]
        loss, of_x, of_head = 0.0, [], 0.0
        classes = torch.arange(n_classes, device=x.device)
        for rows, asked, share in chunks(weight, x, targets, weights):
            nll, total, logits = nll_and_total(rows, weight, asked, n_classes)
            loss = loss + (nll * share).sum()
            slope = torch.exp(logits - total[:, None]) - (classes == asked[:, None]).float()
            slope = F.pad((slope * share[:, None]).to(x.dtype), (0, weight.shape[1] - n_classes))
            of_x.append(slope @ weight.T)
            of_head = of_head + (rows.T @ slope).float()
        ctx.save_for_backward(torch.cat(of_x), of_head[:, :n_classes])
        return loss

    @staticmethod
    def backward(ctx, of_loss):
        of_x, of_head = ctx.saved_tensors
        return of_x * of_loss.to(of_x.dtype), of_head * of_loss, None, None
