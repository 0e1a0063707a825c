"""The transformer tokenizer in PyTorch against the reference that the built-in one is held to.

    python3 -m unittest discover python/tests
"""

import json
import unittest
from pathlib import Path

try:
    import torch
    from safetensors import safe_open

    from isoflop.torch.tokenizer import transformer
    from isoflop.torch.tokenizer.noise import Noise
except ImportError:
    torch = None

FIXTURES = Path(__file__).resolve().parents[2] / "tests/fixtures/transformer-tokenizer"
N_FEATURES = 70
# Of the largest value, as for the built-in one.
WITHIN = 2e-6


def captions(vectors, words):
    """Captions that lie one after another, padded to the longest."""
    padded = torch.zeros(len(words), max(words), vectors.shape[1])
    for own, rows in zip(padded, vectors.split(words)):
        own[: len(rows)] = rows
    return transformer.Said(padded, torch.tensor(words))


@unittest.skipIf(torch is None, "torch is not installed")
class Reference(unittest.TestCase):
    def test_latents_and_frames_are_those_of_the_reference(self):
        paths = sorted(FIXTURES.glob("*.safetensors"))
        self.assertEqual(len(paths), 7)
        for path in paths:
            with self.subTest(path.stem), safe_open(path, "pt") as file:
                tensors = {name: file.get_tensor(name) for name in file.keys()}
                notes = json.loads(file.metadata()["reference"])
                self.check(tensors, notes["sizes"] | {"dropout": 0.0}, notes["words"])

    def check(self, tensors, sizes, words):
        said, noise = captions(tensors["captions"], words), Noise(0, 0)
        halves = [("encoder", transformer.Encoder, "clips", "encoded")]
        halves.append(("decoder", transformer.Decoder, "latents", "decoded"))
        for name, kind, shown, expected in halves:
            half, prefix = kind(sizes, N_FEATURES), f"{name}."
            own = {key.removeprefix(prefix): value for key, value in tensors.items() if key.startswith(prefix)}
            half.load_state_dict(own)
            with torch.no_grad():
                frames = [tensors["clips"].shape[1]] if name == "decoder" else []
                made = half(tensors[shown], *frames, said, noise)
            expected = tensors[expected]
            self.assertLess((made - expected).abs().max() / expected.abs().max(), WITHIN)


if __name__ == "__main__":
    unittest.main()
