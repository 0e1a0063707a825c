"""Training steps of isoflop beside the same work in PyTorch, on one thread.

The models are those of `crates/model/src/generator`, written in PyTorch: text vectors through a linear layer, codes
through an embedding, pre-RMSNorm blocks with RoPE, fused scaled-dot-product attention and SwiGLU,
an untied head on the rows that predict motion, mean cross-entropy, gradient clipping, fused AdamW;
the scale-by-scale transformer, of the same blocks, with a dense mask and a head a scale; and both
halves of the transformer tokenizer with language, without the quantizer between them.
PyTorch runs eagerly and through `torch.compile`.

The sides take turns, each a pass of some seconds, in one process each that stays alive; a pass
gives the median of the processor seconds of its steps, so that other work on the machine matters
little. Ratios are taken within a round. `just bench-peer` builds and runs it.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

AVX2 = "--avx2" in sys.argv
if AVX2:
    # PyTorch's own kernels, oneDNN's and MKL's read these once, at the import; isoflop's at its start.
    held = {"ATEN_CPU_CAPABILITY": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2"}
    os.environ.update(held, MKL_ENABLE_INSTRUCTIONS="AVX2", ISOFLOP_VECTORS="avx2")

import torch
import torch.nn.functional as F
from torch import nn
from torch._inductor import config

D_TEXT = 64

# Layers, heads, width, codes, text vectors, codes of a clip, clips: as in benches/train.
CASES = {
    "quickstart-d16-V240": (2, 1, 16, 240, 16, 36, 7),
    "quickstart-d24-V1000": (2, 2, 24, 1000, 16, 36, 7),
    "quickstart-d32-V1000": (2, 2, 32, 1000, 16, 36, 7),
    "S0": (2, 2, 64, 512, 1, 63, 32),
    "S1": (4, 4, 128, 1024, 1, 63, 32),
    "S2": (6, 4, 256, 4096, 1, 63, 32),
    "motion-V1000": (4, 4, 64, 1000, 32, 50, 32),
    "motion-V64000": (4, 4, 64, 64_000, 32, 50, 32),
}

MINI = [1, 2, 3, 5, 7, 10, 13, 17, 21, 25]
MID = [2, 4, 6, 9, 12, 16, 20, 25, 30, 36]
FULL = [3, 6, 10, 15, 20, 25, 30, 36, 42, 49]
LATENTS, WORDS = 49, 16

# Layers, heads, width, hidden width, channels of a latent, mean codebook, clips, codes of each scale.
SCALEWISE = {
    "scalewise-nano": (2, 2, 48, 128, 32, 256, 8, MINI),
    "scalewise-mid": (4, 4, 128, 344, 128, 512, 8, MID),
    "scalewise-lg-tok": (8, 6, 384, 768, 512, 512, 4, FULL),
}

# Width, layers, channels of a latent, frames, clips.
TOKENIZERS = {
    "tokenizer-nano": (64, 3, 32, 100, 16),
    "tokenizer-mid": (128, 5, 128, 144, 8),
    "tokenizer-lg-tok": (256, 9, 512, 196, 2),
}
FEATURES, SEEN, CAPTION, HEADS = 263, 67, 12, 4

# Of 1024³, by isoflop and by the crate `gemm`, which would keep AVX-512 with --avx2.
PRODUCTS = {"own-product": "isoflop"} if AVX2 else {"own-product": "isoflop", "product": "gemm"}


def matrix(rows, columns, std):
    """A linear layer without bias, drawn from a normal distribution."""
    layer = nn.Linear(rows, columns, bias=False)
    nn.init.normal_(layer.weight, 0.0, std)
    return layer


class Block(nn.Module):
    """x + Attention(RMSNorm(x)), then x + SwiGLU(RMSNorm(x))."""

    def __init__(self, d, n_head, d_ff, n_layer):
        super().__init__()
        std = (2 / (5 * d)) ** 0.5
        self.n_head = n_head
        self.norm_attention = nn.RMSNorm(d, eps=1e-5)
        self.qkv = matrix(d, 3 * d, std)
        self.output = matrix(d, d, std / (2 * n_layer) ** 0.5)
        self.norm_ffn = nn.RMSNorm(d, eps=1e-5)
        self.up = matrix(d, 2 * d_ff, std)
        self.down = matrix(d_ff, d, std / (2 * n_layer) ** 0.5)

    def attention(self, x, angles, mask):
        b, t, d = x.shape
        parts = self.qkv(x).view(b, t, 3, self.n_head, d // self.n_head)
        q, k, v = parts.permute(2, 0, 3, 1, 4)
        q, k = turn(q, *angles), turn(k, *angles)
        mixed = F.scaled_dot_product_attention(q, k, v, attn_mask=mask, is_causal=mask is None)
        return self.output(mixed.transpose(1, 2).reshape(b, t, d))

    def forward(self, x, angles, mask):
        x = x + self.attention(self.norm_attention(x), angles, mask)
        gate, up = self.up(self.norm_ffn(x)).chunk(2, -1)
        return x + self.down(F.silu(gate) * up)


def turn(x, cos, sin):
    """RoPE, in the half-split order, which PyTorch computes with fewer copies."""
    a, b = x.chunk(2, -1)
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1)


class Transformer(nn.Module):
    """`[text | codes]` of each clip to the mean cross-entropy of its codes and end token."""

    def __init__(self, n_layer, n_head, d, n_vocab, n_text, n_codes):
        super().__init__()
        d_ff = -(-(8 * d // 3) // 8) * 8
        self.n_text = n_text
        self.text = nn.Linear(D_TEXT, d)
        self.embedding = nn.Embedding(n_vocab + 2, d)
        nn.init.normal_(self.embedding.weight, 0.0, (2 / (5 * d)) ** 0.5)
        blocks = (Block(d, n_head, d_ff, n_layer) for _ in range(n_layer))
        self.blocks = nn.ModuleList(blocks)
        self.norm = nn.RMSNorm(d, eps=1e-5)
        self.head = matrix(d, n_vocab + 1, (2 / (5 * d)) ** 0.5)
        t, pairs = n_text + n_codes, d // n_head // 2
        angles = torch.arange(t)[:, None] * 10_000.0 ** (-torch.arange(pairs) / pairs)
        self.register_buffer("cos", angles.cos())
        self.register_buffer("sin", angles.sin())
        mask = torch.ones(t, t, dtype=torch.bool).tril()
        mask[:n_text, :n_text] = True
        self.register_buffer("mask", mask if n_text > 1 else None)

    def forward(self, text, codes, targets):
        x = torch.cat([self.text(text), self.embedding(codes)], 1)
        for block in self.blocks:
            x = block(x, (self.cos, self.sin), self.mask)
        logits = self.head(self.norm(x[:, self.n_text - 1 :]))
        return F.cross_entropy(logits.flatten(0, 1), targets.flatten())


class Scalewise(nn.Module):
    """`[text | scale 1 | scale 2 | ...]` of each clip to the mean cross-entropy of its codes."""

    def __init__(self, n_layer, n_head, d, d_ff, d_latent, n_vocab, lengths):
        super().__init__()
        self.lengths = lengths
        self.text, self.input = nn.Linear(D_TEXT, d), nn.Linear(d_latent, d)
        self.starts = nn.Parameter(torch.randn(lengths[0], d) * 0.1)
        self.length = nn.Embedding(LATENTS, d)
        self.levels = nn.Embedding(len(lengths), d)
        blocks = (Block(d, n_head, d_ff, n_layer) for _ in range(n_layer))
        self.blocks = nn.ModuleList(blocks)
        self.norm = nn.RMSNorm(d, eps=1e-5)
        std = (2 / (5 * d)) ** 0.5
        heads = (matrix(d, v, std) for v in codebooks(n_vocab, lengths))
        self.heads = nn.ModuleList(heads)
        places = [torch.arange(-WORDS, 0.0)] + [64 * (torch.arange(n) + 0.5) / n for n in lengths]
        pairs = d // n_head // 2
        angles = torch.cat(places)[:, None] * 100.0 ** (-torch.arange(pairs) / pairs)
        self.register_buffer("cos", angles.cos())
        self.register_buffer("sin", angles.sin())
        scale = torch.cat([torch.full((n,), k) for k, n in enumerate([WORDS, *lengths])])
        self.register_buffer("mask", scale[None, :] <= scale[:, None])
        self.register_buffer("level", scale[WORDS:] - 1)

    def forward(self, text, inputs, lengths, targets):
        length = self.length(lengths)[:, None]
        starts = (self.starts + length).expand(len(text), -1, -1)
        codes = torch.cat([starts, self.input(inputs)], 1) + self.levels(self.level)
        x = torch.cat([self.text(text) + length, codes], 1)
        for block in self.blocks:
            x = block(x, (self.cos, self.sin), self.mask)
        parts = self.norm(x[:, WORDS:]).split(self.lengths, 1)
        scales = zip(self.heads, parts, targets)
        sums = [F.cross_entropy(h(x).flatten(0, 1), t, reduction="sum") for h, x, t in scales]
        return sum(sums) / (len(text) * sum(self.lengths))


def codebooks(n_vocab, lengths):
    """Half of the mean to three halves of it, in equal steps."""
    return [n_vocab // 2 + n_vocab * k // (len(lengths) - 1) for k in range(len(lengths))]


class Cross(nn.Module):
    """Attention from frames to latents or words."""

    def __init__(self, d):
        super().__init__()
        self.query, self.key_value = nn.Linear(d, d), nn.Linear(d, 2 * d)
        self.output = nn.Linear(d, d)

    def forward(self, x, memory):
        b, t, d = x.shape
        heads = lambda x: x.view(b, -1, HEADS, d // HEADS).transpose(1, 2)
        key, value = self.key_value(memory).chunk(2, -1)
        mixed = F.scaled_dot_product_attention(heads(self.query(x)), heads(key), heads(value))
        return self.output(mixed.transpose(1, 2).reshape(b, t, d))


class TokenizerLayer(nn.Module):
    """Attention, cross-attention to each memory, SwiGLU; RMSNorm after each sum."""

    def __init__(self, d, n_memories):
        super().__init__()
        self.qkv, self.output = nn.Linear(d, 3 * d), nn.Linear(d, d)
        self.up, self.down = nn.Linear(d, 8 * d), nn.Linear(4 * d, d)
        self.crosses = nn.ModuleList(Cross(d) for _ in range(n_memories))
        self.norms = nn.ModuleList(nn.RMSNorm(d, eps=1e-5) for _ in range(n_memories + 2))

    def attention(self, x, angles):
        b, t, d = x.shape
        q, k, v = self.qkv(x).view(b, t, 3, HEADS, d // HEADS).permute(2, 0, 3, 1, 4)
        mixed = F.scaled_dot_product_attention(turn(q, *angles), turn(k, *angles), v)
        return self.output(mixed.transpose(1, 2).reshape(b, t, d))

    def forward(self, x, angles, memories):
        x = self.norms[0](x + self.attention(x, angles))
        for norm, cross, memory in zip(self.norms[1:], self.crosses, memories):
            x = norm(x + cross(x, memory))
        gate, up = self.up(x).chunk(2, -1)
        return self.norms[-1](x + self.down(F.silu(gate) * up))


class Half(nn.Module):
    """Layers with skips from those before the middle one to those after it, between two norms."""

    def __init__(self, d, layers, n_memories, rows):
        super().__init__()
        self.layers = nn.ModuleList(TokenizerLayer(d, n_memories) for _ in range(layers))
        self.joins = nn.ModuleList(nn.Linear(2 * d, d) for _ in range(layers // 2))
        self.norms = nn.ModuleList(nn.RMSNorm(d, eps=1e-5) for _ in range(2))
        pairs = d // HEADS // 2
        angles = torch.arange(rows)[:, None] * 100.0 ** (-torch.arange(pairs) / pairs)
        self.register_buffer("cos", angles.cos())
        self.register_buffer("sin", angles.sin())

    def forward(self, x, memories=()):
        x, given, half = self.norms[0](x), [], len(self.joins)
        for i, layer in enumerate(self.layers):
            if i > half:
                x = self.joins[i - half - 1](torch.cat([x, given.pop()], -1))
            x = layer(x, (self.cos, self.sin), memories)
            if i < half:
                given.append(x)
        return self.norms[1](x)


class Tokenizer(nn.Module):
    """Both halves of the transformer tokenizer to the mean squared error of the features."""

    def __init__(self, d, layers, latent, frames):
        super().__init__()
        t = frames // 4
        self.motion, self.words = nn.Linear(SEEN, d), nn.Linear(D_TEXT, d)
        self.latents = nn.Parameter(torch.randn(t, d) * d**-0.5)
        self.encoder = Half(d, layers, 0, CAPTION + t + frames)
        self.to_codes = nn.Conv1d(d, latent, 3, padding=1)
        self.from_codes = nn.Conv1d(latent, d, 3, padding=1)
        self.frames = nn.Parameter(torch.randn(frames, d) * d**-0.5)
        self.read = nn.Linear(D_TEXT, d)
        self.decoder = Half(d, layers, 2, frames)
        self.output = nn.Linear(d, FEATURES)

    def forward(self, x, text):
        b, t = len(x), len(self.latents)
        latents = self.latents.expand(b, -1, -1)
        rows = torch.cat([self.words(text), latents, self.motion(x[:, :, :SEEN])], 1)
        latents = self.encoder(rows)[:, CAPTION : CAPTION + t].transpose(1, 2)
        latents = self.from_codes(self.to_codes(latents)).transpose(1, 2)
        frames = self.decoder(self.frames.expand(b, -1, -1), (latents, self.read(text)))
        return F.mse_loss(self.output(frames), x)


def tokenizer(case):
    """A tokenizer and what it is called with."""
    *sizes, frames, clips = TOKENIZERS[case]
    x = torch.sin(torch.arange(clips * frames * FEATURES) * 0.01).view(clips, frames, FEATURES)
    return Tokenizer(*sizes, frames), (x, torch.full((clips, CAPTION, D_TEXT), 0.5))


def autoregressive(case):
    """A model and what it is called with."""
    n_layer, n_head, d, n_vocab, n_text, n_codes, clips = CASES[case]
    model = Transformer(n_layer, n_head, d, n_vocab, n_text, n_codes)
    text = torch.full((clips, n_text, D_TEXT), 0.5)
    codes = (torch.arange(n_codes) * 7 % n_vocab).expand(clips, n_codes).contiguous()
    return model, (text, codes, F.pad(codes, (0, 1), value=n_vocab))


def scalewise(case):
    """The same for the scale-by-scale model."""
    *sizes, n_vocab, clips, lengths = SCALEWISE[case]
    model = Scalewise(*sizes, n_vocab, lengths)
    text = torch.full((clips, WORDS, D_TEXT), 0.5)
    inputs = torch.full((clips, sum(lengths[1:]), sizes[-1]), 0.5)
    books = zip(codebooks(n_vocab, lengths), lengths)
    targets = [(torch.arange(n) * 7 % v).repeat(clips) for v, n in books]
    return model, (text, inputs, torch.full((clips,), LATENTS - 1), targets)


def stepper(case, compiled):
    """A function that does one training step and returns its loss."""
    torch.manual_seed(0)
    kinds = [(CASES, autoregressive), (SCALEWISE, scalewise), (TOKENIZERS, tokenizer)]
    model, arguments = next(made(case) for cases, made in kinds if case in cases)
    optimiser = torch.optim.AdamW(
        model.parameters(), lr=1e-3, betas=(0.9, 0.95), eps=1e-8, weight_decay=1e-6, fused=True
    )
    forward = torch.compile(model) if compiled else model

    def step():
        loss = forward(*arguments)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        return loss.item()

    return step


def timed(step, seconds):
    """The median of the processor seconds of a step, over a pass of at least three."""
    times, started = [], time.perf_counter()
    while len(times) < 3 or time.perf_counter() - started < seconds:
        before = time.process_time()
        step()
        times.append(time.process_time() - before)
    return statistics.median(times)


class Ours:
    """A process of isoflop's bench that times what it is asked to."""

    def __init__(self, program):
        command = [program] if program else ["cargo", "bench", "--quiet", "--bench", "train", "--"]
        command.append("--serve")
        # The allocator keeps what is freed, and takes large pages, as in a worker of a sweep.
        allocator = {"MIMALLOC_PURGE_DELAY": "-1", "MIMALLOC_ALLOW_LARGE_OS_PAGES": "1"}
        environment = {**allocator, **os.environ, "RAYON_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def ask(self, case, seconds):
        self.process.stdin.write(f"{case} {seconds}\n")
        self.process.stdin.flush()

    def answer(self):
        line = self.process.stdout.readline()
        return json.loads(line) if line else sys.exit("the bench of isoflop has ended")

    def run(self, case, seconds):
        self.ask(case, seconds)
        return self.answer()

    def rate(self, case, seconds):
        """FLOPs a second."""
        answer = self.run(case, seconds)
        return answer["flops"] / answer["step_s"]


def product_rate(seconds):
    """FLOPs a second of a product of 1024³ by PyTorch."""
    a, b = torch.ones(2, 1024, 1024)
    return 2 * 1024**3 / timed(lambda: a @ b, seconds)


def product_rates(ours, seconds):
    """FLOPs a second of a product of 1024³, by who computes it."""
    rates = {name: ours.rate(product, seconds) for product, name in PRODUCTS.items()}
    return rates | {"PyTorch": product_rate(seconds)}


def spread(values, digits=2):
    """The median, with the least and the most."""
    least, most = min(values), max(values)
    return f"{statistics.median(values):.{digits}f} ({least:.{digits}f} to {most:.{digits}f})"


def beside_peer(ours, case, modes, options):
    """A row of the first table. The peak is the fastest of the products."""
    steppers = {mode: stepper(case, mode == "compile") for mode in modes}
    for step in steppers.values():
        step(), step(), step()
    ours.run(case, 0.2)
    tokens_s, shares, ratios = [], [], {mode: [] for mode in modes}
    for _ in range(options.rounds):
        peak = max(product_rates(ours, 0.3).values())
        mine = ours.run(case, options.seconds)
        tokens_s.append(mine["tokens"] / mine["step_s"])
        shares.append(100 * mine["flops"] / mine["step_s"] / peak)
        for mode, step in steppers.items():
            ratios[mode].append(timed(step, options.seconds) / mine["step_s"])
    cells = [f"{statistics.median(tokens_s):.0f}", spread(shares, 0)]
    return [case, *cells, *(spread(ratios[mode]) for mode in modes)]


def two_beside(pair, case, options):
    """Throughput of two processes at once over that of one, by processor seconds and by the clock.

    By processor seconds, as if each had a core to itself: what is left of 2 is what they take
    from one another in caches and memory. By the clock, what else runs on the cores counts too.
    """
    for one in pair:
        one.run(case, 0.2)
    ratios = {"step_s": [], "wall_s": []}
    for _ in range(options.rounds):
        alone = pair[0].run(case, options.seconds)
        for one in pair:
            one.ask(case, options.seconds)
        answers = [one.answer() for one in pair]
        for clock, found in ratios.items():
            found.append(sum(alone[clock] / answer[clock] for answer in answers))
    return [case, *(spread(found) for found in ratios.values())]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", default=",".join(CASES | SCALEWISE | TOKENIZERS), help="which, with commas")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=1.0, help="of a pass")
    parser.add_argument("--avx2", action="store_true", help="both sides without AVX-512")
    parser.add_argument("--no-compile", action="store_true", help="leave torch.compile out")
    parser.add_argument("--beside", action="store_true", help="time two processes at once too")
    parser.add_argument("--only-beside", action="store_true", help="that alone, no PyTorch")
    parser.add_argument("--program", help="the bench as built, in place of asking cargo for it")
    options = parser.parse_args()
    torch.set_num_threads(1)
    if options.avx2:
        config.cpp.simdlen, config.cpp.march = 256, "haswell"
    modes = ["eager"] if options.no_compile else ["eager", "compile"]
    ours = Ours(options.program)
    passes = [product_rates(ours, 0.5) | {"limit": ours.rate("limit", 0.5)} for _ in range(3)]
    best = {name: max(one[name] for one in passes) / 1e9 for name in passes[0]}
    limit, by = best.pop("limit"), ", ".join(f"{rate:.0f} by {name}" for name, rate in best.items())
    print(
        f"PyTorch {torch.__version__} with {torch.backends.cpu.get_cpu_capability()}; GF/s of a"
        f" product of 1024³: {by}; of multiply-adds of registers: {limit:.0f}\n",
        flush=True,
    )
    cases = options.cases.split(",")
    if not options.only_beside:
        header = ["case", "tokens/s", "% of product", *(f"ratio to {mode}" for mode in modes)]
        for row in [header, ["---"] * len(header)]:
            print(f"| {' | '.join(row)} |")
        for case in cases:
            print(f"| {' | '.join(beside_peer(ours, case, modes, options))} |", flush=True)
    if options.beside or options.only_beside:
        print("\n| case | two at once over one | by the clock |\n| --- | --- | --- |")
        pair = (ours, Ours(options.program))
        for case in cases:
            print(f"| {' | '.join(two_beside(pair, case, options))} |", flush=True)


if __name__ == "__main__":
    main()
