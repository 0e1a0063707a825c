"""ScaMo's transformer in PyTorch as a trainer that isoflop starts: the built-in model, trained by other code.

It reads the codes and the embedded captions of a sweep, draws the same initial distribution, sees every
supervised token once an epoch in batches of `batch_tokens`, follows the learning rate of the spec, and
measures the cross-entropy of the test split beside that of the unigram model. A checkpoint is written every
twenty seconds. Needs torch and numpy; runs on a GPU where there is one.

experiments/torch-trainer.yaml is a sweep of it, docs/custom-trainer.md the guide.
"""

import argparse
import json
import math
import os
import sys
import time

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

CHECKPOINT_S = 20.0
TYPES = {"F32": np.float32, "U32": np.uint32, "U64": np.uint64}


def columns(path):
    """The arrays of a safetensors file, and its notes."""
    with open(path, "rb") as file:
        length = int.from_bytes(file.read(8), "little")
        header = json.loads(file.read(length))
        data = np.memmap(path, np.uint8, "r", offset=8 + length)
    notes = header.pop("__metadata__", {})
    arrays = {}
    for name, at in header.items():
        first, end = at["data_offsets"]
        arrays[name] = data[first:end].view(TYPES[at["dtype"]]).reshape(at["shape"])
    return arrays, notes


class Corpus:
    """Codes and captions of the clips of each split."""

    def __init__(self, spec):
        self.codes, notes = columns(spec["codes"])
        grid = json.loads(notes["grid"])
        if len(grid["scales"]) != 1:
            sys.exit("this trainer knows one code after another, and no scales")
        self.text, notes = columns(spec["text"])
        self.d_text, self.end = int(notes["dim"]), spec["n_vocab"]

    def n_clips(self, split):
        return len(self.codes[f"{split}.frames"])

    def clip(self, split, index):
        """Codes and end token of a clip."""
        first, end = self.codes[f"{split}.offsets"][index : index + 2].astype(int)
        return np.append(self.codes[f"{split}.codes"][first:end].astype(np.int64), self.end)

    def caption(self, split, index, which):
        """Vectors of caption `which`, counted round, of a clip: `[words, d_text]`."""
        first, end = self.text[f"{split}.offsets"][index : index + 2].astype(int)
        caption = int(self.text[f"{split}.captions"][first + which % (end - first)])
        first, end = self.text["words"][caption : caption + 2].astype(int)
        return self.text["embeddings"].reshape(-1, self.d_text)[first:end]

    def unigram(self):
        """-ln p of each code and the end token, from the training split with one added to each."""
        counts = np.bincount(self.codes["train.codes"].astype(np.int64), minlength=self.end + 1)
        counts[self.end] = self.n_clips("train")
        return -np.log((counts + 1) / (counts.sum() + self.end + 1))

    def stream(self, seed, first):
        """Parts (clip, caption, from, to) of the training split without an end, from target `first` on."""
        lengths = np.diff(self.codes["train.offsets"].astype(np.int64)) + 1
        epoch, skip = divmod(first, int(lengths.sum()))
        while True:
            draws = np.random.default_rng([seed, epoch])
            order = draws.permutation(len(lengths))
            which = draws.integers(0, 1 << 30, len(lengths))
            for clip in order:
                length = int(lengths[clip])
                if skip < length:
                    yield int(clip), int(which[clip]), skip, length
                skip = max(0, skip - length)
            epoch += 1

    def batches(self, seed, step, n):
        """Batches of `n` supervised tokens; a clip that straddles two has its own part in each."""
        stream, left = self.stream(seed, step * n), None
        while True:
            parts, room = [], n
            while room > 0:
                clip, which, first, end = left or next(stream)
                taken = min(end, first + room)
                parts.append((clip, which, first, taken))
                left = (clip, which, taken, end) if taken < end else None
                room -= taken - first
            yield parts


class Block(nn.Module):
    """x + Attention(RMSNorm(x)), then x + SwiGLU(RMSNorm(x))."""

    def __init__(self, shape):
        super().__init__()
        d, d_ff = shape["d_model"], shape["d_ff"]
        std = math.sqrt(2 / (5 * d))
        back = std / math.sqrt(2 * shape["n_layer"])
        self.n_head = shape["n_head"]
        self.norms = nn.ModuleList(nn.RMSNorm(d, eps=1e-5) for _ in range(2))
        self.qkv, self.output = matrix(d, 3 * d, std), matrix(d, d, back)
        self.up, self.down = matrix(d, 2 * d_ff, std), matrix(d_ff, d, back * math.sqrt(d / d_ff))

    def forward(self, x, cos, sin, mask):
        b, t, d = x.shape
        parts = self.qkv(self.norms[0](x)).view(b, t, 3, self.n_head, d // self.n_head)
        q, k, v = parts.permute(2, 0, 3, 1, 4)
        q, k = turned(q, cos, sin), turned(k, cos, sin)
        mixed = F.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        x = x + self.output(mixed.transpose(1, 2).reshape(b, t, d))
        gate, up = self.up(self.norms[1](x)).chunk(2, -1)
        return x + self.down(F.silu(gate) * up)


def matrix(rows, columns, std):
    layer = nn.Linear(rows, columns, bias=False)
    nn.init.normal_(layer.weight, 0.0, std)
    return layer


def turned(x, cos, sin):
    """Rotary position embedding."""
    a, b = x.chunk(2, -1)
    return torch.cat([a * cos - b * sin, a * sin + b * cos], -1)


class Transformer(nn.Module):
    """`[text | codes]`: text sees all text, codes see all before them."""

    def __init__(self, spec):
        super().__init__()
        shape, n_vocab = spec["shape"], spec["n_vocab"]
        if shape["ffn"] != "swiglu" or shape["tie_embeddings"]:
            sys.exit("this trainer knows SwiGLU and embeddings that are not tied")
        d, d_text = shape["d_model"], shape["d_text"]
        std = math.sqrt(2 / (5 * d))
        self.text = nn.Linear(d_text, d)
        nn.init.normal_(self.text.weight, 0.0, math.sqrt(2 / (5 * d_text)) * std)
        nn.init.zeros_(self.text.bias)
        self.embedding = nn.Embedding(n_vocab + 2, d)
        nn.init.normal_(self.embedding.weight, 0.0, std)
        self.blocks = nn.ModuleList(Block(shape) for _ in range(shape["n_layer"]))
        self.norm = nn.RMSNorm(d, eps=1e-5)
        self.head = matrix(d, n_vocab + 1, std)
        pairs = d // shape["n_head"] // 2
        rates = shape["rope_base"] ** (-torch.arange(pairs, dtype=torch.float64) / pairs)
        angles = torch.arange(shape["n_ctx"])[:, None] * rates
        self.register_buffer("cos", angles.cos().float(), persistent=False)
        self.register_buffer("sin", angles.sin().float(), persistent=False)

    def nll(self, sequences):
        """-ln p of the supervised targets of (text, codes, from, to), one after another."""
        device = self.cos.device
        words = [len(text) for text, *_ in sequences]
        rows = [n + to - 1 for n, (_, _, _, to) in zip(words, sequences)]
        b, t, w = len(sequences), max(rows), max(words)
        text = torch.zeros(b, w, self.text.in_features)
        codes = torch.full((b, t), self.embedding.num_embeddings - 1)
        is_text, picked, targets = torch.zeros(b, t, dtype=torch.bool), [], []
        mask = torch.ones(t, t, dtype=torch.bool).tril().repeat(b, 1, 1)
        for i, (vectors, ids, first, to) in enumerate(sequences):
            n = words[i]
            text[i, :n] = torch.from_numpy(np.array(vectors))
            codes[i, n : n + to - 1] = torch.from_numpy(ids[: to - 1])
            is_text[i, :n] = True
            mask[i, :n, :n] = True
            picked += [i * t + n - 1 + k for k in range(first, to)]
            targets += ids[first:to].tolist()
        text, codes, mask = text.to(device), codes.to(device), mask.to(device)[:, None]
        projected = F.pad(self.text(text), (0, 0, 0, t - w))
        x = torch.where(is_text.to(device)[..., None], projected, self.embedding(codes))
        for block in self.blocks:
            x = block(x, self.cos[:t], self.sin[:t], mask)
        logits = self.head(self.norm(x.flatten(0, 1)[torch.tensor(picked, device=device)]))
        return F.cross_entropy(logits, torch.tensor(targets, device=device), reduction="none")


def rate(lr, step, steps):
    """The learning rate of a step, from 0, as `TrainerLr` says it."""
    if step < lr["warmup_steps"]:
        return lr["peak"] * (step + 1) / lr["warmup_steps"]
    if lr["schedule"] == "wsd":
        decay = lr["decay_steps"]
        share = max(0.0, (step + 1 - (steps - decay)) / decay) if decay else 0.0
        return lr["peak"] * (1 - (1 - lr["final_share"]) * math.sqrt(share))
    share = (step + 1 - lr["warmup_steps"]) / max(1, steps - lr["warmup_steps"])
    return lr["peak"] * (lr["final_share"] + (1 - lr["final_share"]) * (1 + math.cos(math.pi * share)) / 2)


@torch.no_grad()
def measured(model, corpus):
    """Mean nats of the test split, of the model and of the unigram model; clip i shows caption i."""
    unigram = corpus.unigram()
    nats, by_unigram, n = 0.0, 0.0, 0
    clips = range(corpus.n_clips("test"))
    for first in range(0, len(clips), 64):
        batch = [(corpus.caption("test", i, i), corpus.clip("test", i)) for i in clips[first : first + 64]]
        nats += model.nll([(text, ids, 0, len(ids)) for text, ids in batch]).double().sum().item()
        by_unigram += sum(unigram[ids].sum() for _, ids in batch)
        n += sum(len(ids) for _, ids in batch)
    return nats / n, float(by_unigram) / n


def write_whole(path, write):
    """Into a file beside it, then renamed: a kill leaves the old file or the new one."""
    write(path + ".new")
    os.replace(path + ".new", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("--spec", "--out", "--checkpoint"):
        parser.add_argument(name, required=True)
    args = parser.parse_args()
    with open(args.spec) as file:
        spec = json.load(file)
    torch.manual_seed(spec["seed"])
    device = "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cpu":
        torch.set_num_threads(1)

    corpus, model = Corpus(spec), Transformer(spec).to(device)
    adam = torch.optim.AdamW(
        model.parameters(),
        betas=spec["betas"],
        eps=spec["epsilon"],
        weight_decay=spec["weight_decay"],
    )
    state_path, first = os.path.join(args.checkpoint, "state.pt"), 0
    if os.path.exists(state_path):
        state = torch.load(state_path, map_location=device)
        model.load_state_dict(state["model"])
        adam.load_state_dict(state["adam"])
        first = state["step"]
        print(f"going on from step {first}", flush=True)

    steps, saved = spec["steps"], time.monotonic()
    batches = corpus.batches(spec["seed"], first, spec["batch_tokens"])
    for step in range(first, steps):
        parts = next(batches)
        sequences = [
            (corpus.caption("train", clip, which), corpus.clip("train", clip), start, end)
            for clip, which, start, end in parts
        ]
        loss = model.nll(sequences).mean()
        adam.zero_grad(set_to_none=True)
        loss.backward()
        if spec["clip_norm"] is not None:
            nn.utils.clip_grad_norm_(model.parameters(), spec["clip_norm"])
        for group in adam.param_groups:
            group["lr"] = rate(spec["lr"], step, steps)
        adam.step()
        if (step + 1) % max(1, steps // 50) == 0:
            print(json.dumps({"step": step + 1, "steps": steps, "loss": loss.item()}), flush=True)
        if time.monotonic() - saved > CHECKPOINT_S:
            state = {"model": model.state_dict(), "adam": adam.state_dict(), "step": step + 1}
            write_whole(state_path, lambda path: torch.save(state, path))
            saved = time.monotonic()

    nats, unigram = measured(model, corpus)
    result = {"loss_nats": nats, "unigram_nats": unigram}
    write_whole(args.out, lambda path: json.dump(result, open(path, "w")))


if __name__ == "__main__":
    main()
