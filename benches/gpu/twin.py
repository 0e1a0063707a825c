"""Losses of the torch trainer on a GPU beside those on a processor, from the same weights on the same batches.

    PYTHONPATH=python python3 benches/gpu/twin.py [--steps 40]
"""

import argparse
import tempfile

import torch
from shapes import corpus, drawn, run_spec

from isoflop.torch import learning
from isoflop.torch.objectives import objective

SHAPE = (4, 4, 128, 384)


def losses(folder, grid, steps, device, precision, compiled):
    """The loss of each step, and of the validation split at the end."""
    torch._dynamo.reset()
    spec = run_spec(folder, grid, SHAPE, 256, 2048, precision)
    spec.steps, spec.lr = steps, spec.lr | {"peak": 1e-3}
    run = objective(spec)
    torch.manual_seed(0)
    drawn(run.model)
    trained = learning.Learning(run, torch.device(device), folder, compiled)
    for packed in learning.prefetched(run, 0, steps):
        trained._take(packed)
        trained.step += 1
    return trained.losses.double().cpu(), trained.measured("val")["loss_nats"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=40)
    args = parser.parse_args()
    cases = [("cpu", "f32", False), ("cpu", "bf16", False)]
    if torch.cuda.is_available():
        cases += [("cuda", p, c) for p in ("f32", "bf16") for c in (False, True)]
    with tempfile.TemporaryDirectory() as folder:
        grid, truth = corpus(folder, 256, clips=512), None
        print("device precision compiled  step 1   largest of 20  last     validation (relative)")
        for device, precision, compiled in cases:
            try:
                found, val = losses(folder, grid, args.steps, device, precision, compiled)
            except Exception as error:
                print(device, precision, compiled, type(error).__name__, str(error)[:3000])
                continue
            truth = truth or (found, val)
            off = (found / truth[0] - 1).abs()
            print(
                f"{device:6} {precision:9} {compiled!s:8}  {off[0]:.1e}  {off[:20].max():.1e}        "
                f"{off[-1]:.1e}  {abs(val / truth[1] - 1):.1e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
