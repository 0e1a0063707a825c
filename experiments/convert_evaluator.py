"""Converts the evaluator behind published tables for `evaluator: {weights: OUT}`.

    python3 experiments/convert_evaluator.py --name guo finest.tar glove mean.npy std.npy --out OUT

The checkpoint is `text_mot_match/model/finest.tar` of Guo et al. (2022; --name guo, 263 features) or of MARDM
(Meng et al. 2024; --name mardm, 67 features); GLOVE holds our_vab_data.npy, our_vab_words.pkl and our_vab_idx.pkl;
mean and deviation are the evaluator's own: `Comp_v6_KLD01/meta/mean.npy` and `std.npy` of the first,
`eval_mean.npy` and `eval_std.npy` of the second. Files are read as plain values: no code in them is run, unless
--trust says so, for a checkpoint that holds more than tensors.

pip install torch numpy
"""

import argparse
import hashlib
import json
import os
import pickle
import struct
import sys
from pathlib import Path

import numpy as np
import torch

ALL = 263
READERS = {"motion": "motion_encoder", "caption": "text_encoder"}
DIRECTIONS = {"forwards": "l0", "backwards": "l0_reverse"}


def linear(out, name, state, key):
    """isoflop multiplies rows by a weight `[in, out]`."""
    out[f"{name}.weight"], out[f"{name}.bias"] = state[f"{key}.weight"].T, state[f"{key}.bias"]


def convolution(out, name, state, key):
    """Taps one below the other, the earliest first: `[k·in, out]`."""
    weight = state[f"{key}.weight"]
    out[f"{name}.affine.weight"] = weight.transpose(2, 1, 0).reshape(-1, weight.shape[0])
    out[f"{name}.affine.bias"] = state[f"{key}.bias"]


def reader(out, name, state):
    linear(out, f"{name}.input", state, "input_emb")
    for place, (direction, suffix) in enumerate(DIRECTIONS.items()):
        out[f"{name}.{direction}.first"] = state["hidden"][place]
        for part, of in [("input", "ih"), ("state", "hh")]:
            out[f"{name}.{direction}.{part}.weight"] = state[f"gru.weight_{of}_{suffix}"].T
            out[f"{name}.{direction}.{part}.bias"] = state[f"gru.bias_{of}_{suffix}"]
    linear(out, f"{name}.hidden", state, "output_net.0")
    out[f"{name}.scale"], out[f"{name}.shift"] = state["output_net.1.weight"], state["output_net.1.bias"]
    linear(out, f"{name}.output", state, "output_net.3")


def networks(checkpoint):
    """The tensors of a checkpoint under isoflop's names."""
    missing = {"movement_encoder", *READERS.values()} - checkpoint.keys()
    if missing:
        sys.exit(f"the checkpoint has no {', '.join(sorted(missing))}: it is no text_mot_match/model/finest.tar")
    states = {
        name: {key: value.detach().float().numpy() for key, value in checkpoint[name].items()}
        for name in ["movement_encoder", *READERS.values()]
    }
    out, movement, text = {}, states["movement_encoder"], states["text_encoder"]
    convolution(out, "movement.first", movement, "main.0")
    convolution(out, "movement.second", movement, "main.3")
    linear(out, "movement.output", movement, "out_net")
    for name, key in READERS.items():
        reader(out, name, states[key])
    out = {f"Matching.{name}": value for name, value in out.items()}
    out["words.parts"] = text["pos_emb.weight"].T + text["pos_emb.bias"]
    return out


def sizes(out):
    """What isoflop derives shapes from; its other widths are multiples of `width`."""
    features, width = (out["Matching.movement.first.affine.weight"].shape[0] // 4, out["Matching.movement.output.bias"].size)
    found = {part: out[f"Matching.{part}.input.bias"].size for part in READERS}
    if found != {"motion": 2 * width, "caption": width} or out["Matching.movement.first.affine.bias"].size != width:
        sys.exit(f"movement of width {width} wants encoders of {2 * width} and {width}, not of {found}")
    if features not in (ALL - 4, 67):
        sys.exit(f"the networks see {features} features: isoflop has the 263 of 22 joints, of which they see 259 or 67")
    dim, word_dim = out["Matching.caption.output.bias"].size, out["words.parts"].shape[1]
    return {"features": features, "width": width, "dim": dim, "word_dim": word_dim}


def statistics(mean, std, features):
    """Mean and deviation of all 263 features; those that are not seen have 0 and 1."""
    mean, std = (np.load(path).astype(np.float32).ravel() for path in (mean, std))
    if len(mean) not in (features, ALL) or mean.shape != std.shape:
        sys.exit(f"mean and deviation have {len(mean)} and {len(std)} numbers, not {features} or {ALL}")
    rest = ALL - len(mean)
    if not (std[:features] > 0).all():
        sys.exit("a deviation is not above 0")
    std = np.where(std > 0, std, np.float32(1))
    return np.pad(mean, (0, rest)), np.pad(std, (0, rest), constant_values=1)


class Plain(pickle.Unpickler):
    """Reads lists, dictionaries, numbers and text alone."""

    def find_class(self, module, name):
        raise pickle.UnpicklingError(f"a list of words needs no {module}.{name}")


def vocabulary(folder):
    """The words in the order of their vectors."""
    vectors = np.load(folder / "our_vab_data.npy").astype(np.float32)
    words, places = (Plain((folder / f"our_vab_{name}.pkl").open("rb")).load() for name in ["words", "idx"])
    return words, vectors[[places[word] for word in words]]


def write(path, data):
    path.with_suffix(".new").write_bytes(data)
    os.replace(path.with_suffix(".new"), path)


def safetensors(tensors):
    """A file of tensors in the order of their names, as single-precision numbers."""
    head, start, parts = {}, 0, []
    for name, value in sorted(tensors.items()):
        data = np.ascontiguousarray(value, "<f4").tobytes()
        head[name] = {"dtype": "F32", "shape": list(value.shape), "data_offsets": [start, start + len(data)]}
        start += len(data)
        parts.append(data)
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + b"".join(parts)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--name", choices=["guo", "mardm"], required=True)
    for name in ["checkpoint", "glove", "mean", "std"]:
        parser.add_argument(name, type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--trust", action="store_true")
    args = parser.parse_args(argv)
    checkpoint = torch.load(args.checkpoint, map_location="cpu", weights_only=not args.trust)
    tensors = networks(checkpoint)
    found = sizes(tensors)
    tensors["stats.mean"], tensors["stats.std"] = statistics(args.mean, args.std, found["features"])
    words, tensors["words.vectors"] = vocabulary(args.glove)
    sources = [args.checkpoint, args.mean, args.std, args.glove / "our_vab_data.npy"]
    sha256 = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sources}
    args.out.mkdir(parents=True, exist_ok=True)
    write(args.out / "weights.safetensors", safetensors(tensors))
    write(args.out / "words.json", json.dumps({"words": words}).encode())
    write(args.out / "evaluator.json", json.dumps({"name": args.name, **found, "sha256": sha256}, indent=1).encode())
    print(f"evaluator: {{weights: {args.out}}}")


if __name__ == "__main__":
    main()
