"""`python3 -m isoflop.torch`: trains one run that isoflop describes."""

import argparse
import json
import os
import sys

NEEDED = "install them by `pip install 'isoflop[torch]'`"
OLDEST = (2, 7)


def main():
    args = arguments()
    try:
        torch = libraries()
        device = chosen(torch, args.device)
        result = train(torch, args, device)
    except SystemExit as end:
        if not isinstance(end.code, str):
            raise
        refuse(args.out, end.code, "trainer")
    write(args.out, result)


def arguments():
    parser = argparse.ArgumentParser(prog="isoflop.torch", description=__doc__)
    parser.add_argument("--spec", required=True, help="the specification of the run, JSON")
    parser.add_argument("--out", required=True, help="where the result goes, JSON")
    parser.add_argument("--checkpoint", required=True, help="a folder that outlives a kill")
    parser.add_argument("--init", required=True, help="the first weights, safetensors")
    parser.add_argument("--device", default="auto", help="auto (a GPU where there is one), cpu, cuda, cuda:1")
    parser.add_argument("--eager", action="store_true", help="on a GPU, compile nothing")
    return parser.parse_args()


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
        # As many runs side by side as there are cores.
        torch.set_num_threads(1)
    return device


def train(torch, args, device):
    """Trains the run; its result as docs/custom-trainer.md has it."""
    from safetensors.torch import load_file, save_file

    from .learning import Failed, Learning, Stopped
    from .objectives import objective
    from .spec import RunSpec

    spec = RunSpec(args.spec)
    run = objective(spec)
    run.model.load_state_dict(load_file(args.init))
    check_memory(torch, run, device)
    learning = Learning(run, device, args.checkpoint, device.type == "cuda" and not args.eager)
    test = None
    try:
        learning.run()
        test = learning.measured("test")
        learning.tracker.log(spec.steps, {"test/loss_normalised": test["loss_normalised"]})
    except Failed as failed:
        refuse(args.out, str(failed), "diverged")
    except torch.OutOfMemoryError as error:
        refuse(args.out, f"the GPU has too little memory: {str(error).splitlines()[0]}", "out-of-memory")
    except Stopped as stopped:
        print(stopped, file=sys.stderr)
        sys.exit(143)
    finally:
        learning.tracker.finish(test is not None)
    weights = os.path.join(os.path.dirname(args.out), "torch.safetensors")
    save_file({name: tensor.contiguous().cpu() for name, tensor in run.model.state_dict().items()}, weights)
    return result(torch, learning, test, device) | {"weights": weights}


def result(torch, learning, test, device):
    totals = learning.totals
    on_gpu = device.type == "cuda"
    found = {key: test[key] for key in ("loss_nats", "loss_normalised", "nats_per_frame")}
    found |= {"normalised_by_scale": test["normalised_by_scale"], "clips": test["clips"]}
    found |= {"log": totals["log"], "wall_s": totals["wall_s"], "flops_exact": 3 * totals["forward_flops"]}
    found["device"] = torch.cuda.get_device_name(device) if on_gpu else "torch cpu"
    if on_gpu:
        found["peak_bytes"] = torch.cuda.max_memory_allocated(device)
    return found


def check_memory(torch, run, device):
    """Ends the run before its first step where the card cannot hold it."""
    if device.type != "cuda":
        return
    free, _ = torch.cuda.mem_get_info(device)
    wanted = run.spec.gpu_bytes
    if wanted > free:
        raise SystemExit(
            f"the run needs about {wanted / 1e9:.1f} GB of the GPU, {free / 1e9:.1f} GB are free: take a larger "
            "card, fewer runs side by side, or a smaller train.batch.max"
        )


def refuse(path, error, kind):
    """Leaves the reason in place of a result, and ends."""
    write(path, {"error": error, "kind": kind})
    print(error, file=sys.stderr)
    sys.exit(1)


def write(path, document):
    """Whole, by rename."""
    partial = path + ".partial"
    with open(partial, "w") as file:
        json.dump(document, file)
    os.replace(partial, path)


if __name__ == "__main__":
    main()
