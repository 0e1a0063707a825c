"""Tokens a second and MFU of the torch trainer at ScaMo's shapes, beside a plain PyTorch loop.

Steps of 8192 supervised tokens on made-up clips of HumanML3D's mean length (36 codes and an end after 12 words),
bf16, on one card. Three trainers take turns: `eager` (nothing compiled), `compiled` (as `trainer: torch` runs on
a GPU), and `plain`, the same transformer as a loop after nanochat: one clip a row, no padding at all since all
clips are equally long, causal flash attention, torch.compile, AdamW. FLOPs are the plan's (OpenAI rule, full
context), so MFU counts supervised tokens alone.

    PYTHONPATH=python python3 benches/gpu/shapes.py [--shapes 44M,111M] [--vocab 1024,65536] [--seconds 3]

On a processor (`--device cpu --tiny`) it tries every path at a tiny shape.
"""

import argparse
import json
import os
import sys
import tempfile
import time
import types

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import save_file
from torch import nn

from isoflop.torch import learning, network
from isoflop.torch.objectives import objective
from isoflop.torch.spec import RunSpec

# n_layer, n_head, d_model, d_ff: ScaMo's Table 1, by the paper's names, and three below it, by N_nv.
SHAPES = {
    "0.1M": (4, 2, 48, 128),
    "1M": (4, 4, 128, 384),
    "6M": (8, 4, 256, 768),
    "44M": (8, 8, 512, 1536),
    "111M": (12, 12, 768, 2048),
    "343M": (24, 16, 1024, 2816),
    "775M": (36, 20, 1280, 3584),
    "tiny": (2, 2, 64, 192),
}
WORDS, CODES, D_TEXT, N_CTX = 12, 36, 2048, 201
# Dense bf16 FLOP/s (data sheets).
PEAKS = {"H100": 989e12, "H200": 989e12, "A100": 312e12}


def corpus(folder, n_vocab, clips=4096):
    """Made-up codes and captions in isoflop's files."""
    random = np.random.default_rng(0)
    grid = {"scales": [{"n_vocab": n_vocab, "length": {"frames_per_code": 4}}], "end_token": True}
    codes, text = {}, {}
    for split, n in (("train", clips), ("val", 8), ("test", 8)):
        codes[f"{split}.codes"] = random.integers(0, n_vocab, n * CODES).astype(np.uint32)
        codes[f"{split}.offsets"] = np.arange(n + 1, dtype=np.uint64) * CODES
        codes[f"{split}.frames"] = np.full(n, 4 * CODES, np.uint64)
        text[f"{split}.captions"] = random.integers(0, 1024, n).astype(np.uint32)
        text[f"{split}.offsets"] = np.arange(n + 1, dtype=np.uint64)
    text["embeddings"] = random.standard_normal((1024 * WORDS, D_TEXT), np.float32).ravel()
    text["words"] = np.arange(1025, dtype=np.uint64) * WORDS
    save_file(codes, f"{folder}/codes", {"grid": json.dumps(grid)})
    save_file(text, f"{folder}/text", {"dim": str(D_TEXT)})
    return grid


def flops_per_token(shape, n_vocab):
    """Training FLOPs a supervised token by the OpenAI rule (ScaMo, Code 1)."""
    n_layer, _, d, _ = shape
    return 3.0 * (4 * d + n_layer * (8 * d * d + 2 * N_CTX * d + 16 * d * d) + 2 * d * n_vocab)


def run_spec(folder, grid, shape, n_vocab, tokens, precision):
    n_layer, n_head, d, f = shape
    sizes = {"n_layer": n_layer, "n_head": n_head, "d_model": d, "d_ff": f, "n_ctx": N_CTX, "d_text": D_TEXT}
    sizes |= {"ffn": "swiglu", "tie_embeddings": False, "rope_base": 1e4}
    spec = types.SimpleNamespace(
        seed=0, shape=sizes, grid=grid, generator={"kind": "autoregressive"}, precision=precision,
        batch_tokens=tokens, steps=10**6, tokens=tokens * 10**6, clips=None, evaluations=1, targets_per_pass=2048,
        budget_flops=flops_per_token(shape, n_vocab) * tokens * 10**6, betas=[0.9, 0.95], epsilon=1e-8,
        weight_decay=0.1, peak_flops=PEAKS, clip_norm=1.0, checkpoint_s=1e9, codes=f"{folder}/codes", text=f"{folder}/text",
        lr={"peak": 1e-4, "warmup_steps": 10, "final_share": 0.1, "schedule": "cosine", "decay_steps": None},
    )
    for name in ("training_clips", "learning_rate", "is_due", "forward_flops"):
        setattr(spec, name, types.MethodType(getattr(RunSpec, name), spec))
    return spec


def drawn(model):
    with torch.no_grad():
        for param in model.parameters():
            param.fill_(1.0) if param.dim() == 1 else param.normal_(0.0, 0.02)


class Ours:
    """The torch trainer's own steps, batches packed and moved as in a run."""

    def __init__(self, spec, device, compiled):
        run = objective(spec)
        drawn(run.model)
        spec.steps = 1 << 16
        self.learning = learning.Learning(run, device, "/tmp", compiled)
        self.batches = learning.prefetched(run, 0, spec.steps)

    def step(self):
        self.learning._take(next(self.batches))
        self.learning.step += 1


class PlainBlock(nn.Module):
    def __init__(self, shape):
        super().__init__()
        _, self.n_head, d, f = shape
        self.qkv, self.out = nn.Linear(d, 3 * d, bias=False), nn.Linear(d, d, bias=False)
        self.gate_up, self.down = nn.Linear(d, 2 * f, bias=False), nn.Linear(f, d, bias=False)

    def forward(self, x, cos, sin):
        b, t, d = x.shape
        qkv = self.qkv(F.rms_norm(x, (d,))).view(b, t, 3, self.n_head, -1)
        q, k, v = qkv.permute(2, 0, 3, 1, 4)
        q, k = (self.turned(y, cos, sin) for y in (q, k))
        y = F.scaled_dot_product_attention(q, k, v, is_causal=True)
        x = x + self.out(y.transpose(1, 2).reshape(b, t, d))
        gate, up = self.gate_up(F.rms_norm(x, (d,))).chunk(2, -1)
        return x + self.down(F.silu(gate) * up)

    @staticmethod
    def turned(x, cos, sin):
        a, b = x.chunk(2, -1)
        return torch.cat([a * cos - b * sin, a * sin + b * cos], -1).to(x.dtype)


class Plain(nn.Module):
    """A GPT as nanochat writes one, with words in front."""

    def __init__(self, shape, n_vocab):
        super().__init__()
        n_layer, n_head, d, _ = shape
        self.text, self.embedding = nn.Linear(D_TEXT, d), nn.Embedding(n_vocab + 2, d)
        self.blocks = nn.ModuleList(PlainBlock(shape) for _ in range(n_layer))
        self.head = nn.Linear(d, -(-(n_vocab + 1) // 64) * 64, bias=False)
        cos, sin = network.angles(range(WORDS + CODES), d // n_head, 1e4)
        self.register_buffer("cos", cos)
        self.register_buffer("sin", sin)

    def forward(self, words, ids):
        x = torch.cat([self.text(words), self.embedding(ids[:, :-1]).to(torch.bfloat16)], 1)
        for block in self.blocks:
            x = block(x, self.cos, self.sin)
        return self.loss(x[:, WORDS - 1 :], ids)

    def loss(self, x, ids):
        x = F.rms_norm(x, (x.shape[-1],))
        return F.cross_entropy(self.head(x).flatten(0, 1).float(), ids.flatten())


class PlainLoop:
    def __init__(self, shape, n_vocab, tokens, device, compiled=True):
        self.model = Plain(shape, n_vocab).to(device)
        if compiled:
            for block in self.model.blocks:
                block.compile(dynamic=False)
            self.model.loss = torch.compile(self.model.loss, dynamic=False)
        self.adam = torch.optim.AdamW(self.model.parameters(), lr=1e-4, betas=(0.9, 0.95), fused=True)
        n = round(tokens / (CODES + 1))
        self.tokens, self.device = n * (CODES + 1), device
        self.words = torch.randn(n, WORDS, D_TEXT, device=device, dtype=torch.bfloat16)
        self.ids = torch.randint(0, n_vocab, (n, CODES + 1), device=device)

    def step(self):
        with torch.autocast(self.device.type, torch.bfloat16):
            loss = self.model(self.words, self.ids)
        loss.backward()
        nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.adam.step()
        self.adam.zero_grad(set_to_none=True)


def timed(trainer, seconds, device):
    """Seconds a step: the median of three parts after steps to warm up; and how long the first step took."""
    wait = torch.cuda.synchronize if device.type == "cuda" else lambda: None
    began = time.perf_counter()
    trainer.step()
    wait()
    first = time.perf_counter() - began
    for _ in range(5):
        trainer.step()
    wait()
    parts = []
    for _ in range(3):
        began, n = time.perf_counter(), 0
        while n < 3 or time.perf_counter() - began < seconds / 3 and n < 2000:
            for _ in range(3):
                trainer.step()
            n += 3
            if device.type == "cuda":
                torch.cuda.current_stream().synchronize()
        wait()
        parts.append((time.perf_counter() - began) / n)
    return sorted(parts)[1], first


def case(args, name, n_vocab, mode, device, folder):
    shape = SHAPES[name]
    torch._dynamo.reset()
    if device.type == "cuda":
        torch.cuda.reset_peak_memory_stats()
    tokens = args.tokens
    if mode == "plain":
        trainer = PlainLoop(shape, n_vocab, tokens, device, device.type == "cuda")
        tokens = trainer.tokens
    else:
        grid = corpus(folder, n_vocab)
        spec = run_spec(folder, grid, shape, n_vocab, tokens, "bf16")
        trainer = Ours(spec, device, mode == "compiled" and device.type == "cuda")
    step_s, first_s = timed(trainer, args.seconds, device)
    row = {"shape": name, "vocab": n_vocab, "mode": mode, "tokens_per_s": tokens / step_s, "step_ms": 1e3 * step_s}
    row["first_s"] = first_s
    peak = learning.peak_flops(device, PEAKS) or float("nan")
    row["mfu"] = tokens / step_s * flops_per_token(shape, n_vocab) / peak
    row["gb"] = torch.cuda.max_memory_allocated() / 1e9 if device.type == "cuda" else 0.0
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shapes", default="44M,111M,343M,775M")
    parser.add_argument("--vocab", default="1024,65536")
    parser.add_argument("--modes", default="compiled,plain,eager")
    parser.add_argument("--tokens", type=int, default=8192)
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--limit", type=float, default=1e9, help="seconds after which no case is begun")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--out", default=None, help="a file for the rows, a JSON document a line")
    args = parser.parse_args()
    if args.tiny:
        args.shapes, args.vocab, args.tokens = "tiny", "64", 256
    device, began = torch.device(args.device), time.time()
    print(torch.__version__, torch.cuda.get_device_name() if device.type == "cuda" else "processor", flush=True)
    print("shape  V      mode      tokens/s    ms/step  MFU    first s  GB", flush=True)
    for name in args.shapes.split(","):
        for n_vocab in map(int, args.vocab.split(",")):
            for mode in args.modes.split(","):
                if time.time() - began > args.limit:
                    sys.exit("out of time")
                with tempfile.TemporaryDirectory() as folder:
                    try:
                        row = case(args, name, n_vocab, mode, device, folder)
                    except Exception as error:
                        print(f"{name:6} {n_vocab:<6} {mode:9} {type(error).__name__}: {str(error)[:1500]}", flush=True)
                        continue
                print(
                    f"{name:6} {n_vocab:<6} {mode:9} {row['tokens_per_s']:<11.0f} {row['step_ms']:<8.2f} "
                    f"{100 * row['mfu']:<6.1f} {row['first_s']:<8.1f} {row['gb']:.1f}",
                    flush=True,
                )
                if args.out:
                    with open(args.out, "a") as file:
                        file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", "/tmp/inductor")
    main()
