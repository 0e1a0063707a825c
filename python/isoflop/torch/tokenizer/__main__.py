"""`python3 -m isoflop.torch.tokenizer`: trains one tokenizer that isoflop describes."""

import json
import os

from ..ends import lead, parser, write


def main():
    lead(parser("isoflop.torch.tokenizer", __doc__).parse_args(), train)


def train(torch, args, device):
    """Trains the tokenizer; where its weights lie, and what training took."""
    from safetensors.torch import load_file, save_file

    from .learning import Learning
    from .spec import Spec

    with open(args.spec) as file:
        spec = Spec(json.load(file))
    learning = Learning(spec, load_file(spec.init), device, args.checkpoint)
    if device.type == "cuda" and not args.eager:
        learning.compile()
    learning.run()
    weights = os.path.join(args.checkpoint, "trained.safetensors")
    save_file({name: tensor.contiguous().cpu() for name, tensor in learning.kept().items()}, weights)
    write(os.path.join(args.checkpoint, "losses.json"), learning.losses.tolist())
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else "torch cpu"
    return {"weights": weights, "wall_s": learning.wall_s, "device": name}


if __name__ == "__main__":
    main()
