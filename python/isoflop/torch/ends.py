"""How training ends: with a result, with a reason why there is none, or at a stop."""

import argparse
import json
import os
import sys

NEEDED = "install them by `pip install 'isoflop[torch]'`"
OLDEST = (2, 7)


class Failed(Exception):
    """Training that ends without a result; `kind` is a word of isoflop's failures."""

    def __init__(self, sentence, kind="diverged"):
        super().__init__(sentence)
        self.kind = kind


class Stopped(Exception):
    """Training that was asked to stop; its checkpoint is written."""


def lead(args, train):
    """Trains on the device that is asked for; the result, or the reason why there is none, goes to `--out`."""
    try:
        torch = libraries()
        result = train(torch, args, chosen(torch, args.device))
    except SystemExit as end:
        if not isinstance(end.code, str):
            raise
        refuse(args.out, end.code, "trainer")
    except Failed as failed:
        refuse(args.out, str(failed), failed.kind)
    except Stopped as stopped:
        print(stopped, file=sys.stderr)
        sys.exit(143)
    except torch.OutOfMemoryError as error:
        refuse(args.out, f"the GPU has too little memory: {str(error).splitlines()[0]}", "out-of-memory")
    write(args.out, result)


def parser(module, about):
    """The options that every trainer has."""
    options = argparse.ArgumentParser(prog=module, description=about)
    options.add_argument("--spec", required=True, help="what is to be trained, JSON")
    options.add_argument("--out", required=True, help="where the result goes, JSON")
    options.add_argument("--checkpoint", required=True, help="a folder that outlives a kill")
    options.add_argument("--device", default="auto", help="auto (a GPU if there is one), cpu, cuda, cuda:1")
    options.add_argument("--eager", action="store_true", help="on a GPU, compile nothing")
    return options


def libraries():
    """torch, once all that is needed is there and new enough."""
    try:
        import numpy  # noqa: F401
        import safetensors  # noqa: F401
        import torch
    except ImportError as missing:
        raise SystemExit(f"the torch trainer needs {missing.name}: {NEEDED}") from missing
    version = tuple(int(part) for part in torch.__version__.split("+")[0].split(".")[:2])
    if version < OLDEST:
        wanted = ".".join(map(str, OLDEST))
        raise SystemExit(f"torch {torch.__version__} is too old, {wanted} is the oldest that will do: {NEEDED}")
    return torch


def chosen(torch, name):
    """The device of a name."""
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    if name.startswith("cuda") and not torch.cuda.is_available():
        raise SystemExit("torch sees no CUDA device here: take `--device cuda` out of the trainer's command")
    device = torch.device(name)
    if device.type == "cpu":
        # As many jobs side by side as there are cores.
        torch.set_num_threads(1)
    return device


def refuse(path, error, kind):
    """Leaves the reason in place of a result, and ends."""
    print(error, file=sys.stderr, flush=True)
    write(path, {"error": error, "kind": kind})
    sys.exit(1)


def write(path, document):
    """Whole, by rename."""
    partial = path + ".partial"
    with open(partial, "w") as file:
        json.dump(document, file)
    os.replace(partial, path)
