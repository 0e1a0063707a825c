"""Embeds the captions of data sets by a language model, for `text: {encoder: file, path: OUT}`.

DATA are folders in the HumanML3D layout, MODEL the name or the folder of a Hugging Face model: BERT, an
encoder and decoder such as T5, or CLIP. Each caption, and each with left and right exchanged, gets the
last hidden state of its tokens (`--level word`) or their mean (`--level sentence`, max_tokens: 1).
The format is described in crates/model/src/text/embedding_file.rs.

pip install torch transformers safetensors blake3   (blake3: the hash that isoflop has; hashlib lacks it)
"""

import argparse
import os
import re
from pathlib import Path

import numpy as np
import torch
from blake3 import blake3
from safetensors.numpy import save_file
from transformers import AutoModel, AutoTokenizer

BATCH = 64
MIRRORED = {"left": "right", "right": "left", "clockwise": "counterclockwise"}
MIRRORED |= {"counterclockwise": "clockwise", "anticlockwise": "clockwise"}


def captions(folders):
    """Those before the first `#` of each line, lower-case with single spaces, and mirrored, sorted."""
    found = set()
    for path in (path for folder in folders for path in Path(folder, "texts").glob("*.txt")):
        for line in path.read_text("utf-8-sig", errors="replace").split("\n"):
            found.add(" ".join(line.split("#")[0].lower().split()))
    mirror = lambda word: MIRRORED.get(word[0], word[0])
    return sorted((found | {re.sub(r"[^\W_]+", mirror, caption) for caption in found}) - {""})


@torch.no_grad()
def vectors(name, texts, level):
    """An array `[tokens, dim]` for each text, padding left out."""
    tokenizer, model = AutoTokenizer.from_pretrained(name), AutoModel.from_pretrained(name).float().eval()
    model = model.get_encoder() if model.config.is_encoder_decoder else getattr(model, "text_model", model)
    for start in range(0, len(texts), BATCH):
        batch = tokenizer(texts[start : start + BATCH], padding=True, truncation=True, return_tensors="pt")
        states = model(input_ids=batch["input_ids"], attention_mask=batch["attention_mask"])
        for state, mask in zip(states.last_hidden_state, batch["attention_mask"].bool()):
            yield (state[mask] if level == "word" else state[mask].mean(0, keepdim=True)).numpy()
        print(f"\r{min(start + BATCH, len(texts))} of {len(texts)} captions", end="", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", nargs="+")
    parser.add_argument("model")
    parser.add_argument("--out", required=True)
    parser.add_argument("--level", choices=["word", "sentence"], default="word")
    args = parser.parse_args()
    texts = captions(args.data)
    found = list(vectors(args.model, texts, args.level))
    keys = [int.from_bytes(blake3(text.encode()).digest()[:8], "little") for text in texts]
    offsets = np.cumsum([0] + [len(vectors) for vectors in found])
    tensors = {"keys": np.array(keys, np.uint64), "offsets": offsets.astype(np.uint64)}
    tensors["embeddings"] = np.concatenate(found).astype(np.float32)
    save_file(tensors, args.out + ".new")
    os.replace(args.out + ".new", args.out)
    dim, longest = tensors["embeddings"].shape[1], max(len(vectors) for vectors in found)
    print(f"\ntext: {{encoder: file, path: {args.out}, dim: {dim}, max_tokens: {longest}}}")


if __name__ == "__main__":
    main()
