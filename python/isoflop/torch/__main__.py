"""`python3 -m isoflop.torch`: trains one run that isoflop describes."""

import os

from .ends import lead, parser


def main():
    options = parser("isoflop.torch", __doc__)
    options.add_argument("--init", required=True, help="the first weights, safetensors")
    lead(options.parse_args(), train)


def train(torch, args, device):
    """Trains the run; its result as docs/custom-trainer.md has it."""
    from safetensors.torch import load_file, save_file

    from .learning import Learning
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
    finally:
        learning.tracker.finish(test is not None)
    weights = os.path.join(os.path.dirname(args.out), "torch.safetensors")
    save_file({name: tensor.contiguous().cpu() for name, tensor in run.model.state_dict().items()}, weights)
    return result(torch, learning, test, device) | {"weights": weights}


def result(torch, learning, test, device):
    totals = learning.totals
    on_gpu = device.type == "cuda"
    found = {key: test[key] for key in ("loss_nats", "loss_normalised", "nats_per_frame")}
    found |= {key: test[key] for key in ("normalised_by_scale", "likeliest_exponential_entropy", "clips")}
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


if __name__ == "__main__":
    main()
