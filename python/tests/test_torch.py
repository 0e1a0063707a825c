"""The torch trainer without isoflop: its random numbers, and its batches on a made-up data set.

    python3 -m unittest discover python/tests
"""

import contextlib
import io
import json
import os
import resource
import tempfile
import unittest
from types import SimpleNamespace

try:
    import numpy as np
    import torch
    from safetensors.numpy import save_file

    from isoflop.torch.chacha import Stream, _blocks
    from isoflop.torch.draws import corrupted, hidden, hidden_codes
    from isoflop.torch.ends import Failed
    from isoflop.torch.learning import Learning, load_state, save_state, split_loss
    from isoflop.torch.objectives import objective
    from isoflop.torch.packing import on_device, room_for
    from isoflop.torch.scale_inputs import Multiscale, area_down, linear_up
    from isoflop.torch.spec import RunSpec
    from isoflop.torch.stream import Parts, TokenStream
except ImportError as error:
    raise unittest.SkipTest(f"the torch trainer needs {error.name}: pip install 'isoflop[torch]'") from error

CODES, LAYERS = [{"codes": n} for n in (1, 2, 4)], [{"frames_per_code": 4}] * 3
MULTISCALE = {"kind": "multiscale", "scales": [1, 2, 4], "mix": None}
RESIDUAL = {"kind": "residual", "layers": 3, "codebook": {"kind": "vq", "n_vocab": 6}}
# Two threads would wait for each other longer than one computes.
torch.set_num_threads(1)
D_TEXT, D_LATENT, MOST_LATENTS, MAX_TEXT = 5, 3, 6, 4


class Published(unittest.TestCase):
    """The built-in trainer's test reads the same file."""

    def test_batches_are_those_that_are_published(self):
        with open(os.path.join(os.path.dirname(__file__), "batches.json")) as file:
            published = json.load(file)
        counts, n = np.array(published["captions"]), published["batch_tokens"]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        captions = SimpleNamespace(offsets={"train": offsets}, captions={"train": np.arange(counts.sum())})
        targets, clips = np.array(published["codes"]) + 1, np.arange(len(counts))
        stream = TokenStream(captions, targets, clips, published["seed"])
        for step, parts in enumerate(published["steps"]):
            np.testing.assert_array_equal(np.stack(stream.parts(step * n, n), 1), parts)
        matched = TokenStream(captions, targets, clips, published["seed"], matched=True)
        own = (offsets[:-1] + clips % counts)[matched.parts(0, 5 * n).clip]
        np.testing.assert_array_equal(matched.parts(0, 5 * n).caption, own)


class Checkpoints(unittest.TestCase):
    def test_a_torn_checkpoint_is_set_aside(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "state.pt")
            self.assertIsNone(load_state(path, "cpu"))
            save_state(path, {"step": 3})
            self.assertEqual(load_state(path, "cpu"), {"step": 3})
            with open(path, "r+b") as file:
                file.truncate(100)
            with contextlib.redirect_stdout(io.StringIO()) as said:
                self.assertIsNone(load_state(path, "cpu"))
            self.assertIn("training begins anew", said.getvalue())
            self.assertEqual(os.listdir(folder), ["state.pt.damaged"])

    def test_a_checkpoint_that_cannot_be_written_leaves_the_last_one(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "state.pt")
            save_state(path, {"step": 3})
            before = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
            try:
                with self.assertRaisesRegex(Failed, "cannot be written"):
                    save_state(path, {"step": 4, "model": torch.zeros(1 << 20)})
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
            self.assertEqual(load_state(path, "cpu"), {"step": 3})


class Draws(unittest.TestCase):
    def test_the_numbers_are_those_of_chacha8(self):
        first = _blocks([0] * 8, 0, 0, 1).tobytes()[:8]
        self.assertEqual(first.hex(), "3e00ef2f895f40d6")

    def test_numbers_are_the_same_however_many_are_looked_at(self):
        one, other = Stream(3, 9), Stream(3, 9)
        one.peek(10_000)
        found = np.concatenate([other.take(n) for n in (1, 7, 5000)])
        np.testing.assert_array_equal(found, one.take(5008))

    def test_codes_are_corrupted_as_one_by_one(self):
        for share in (0.0, 0.05, 0.5, 0.95, 1.0):
            n = np.random.default_rng(0).integers(0, 30, 40)
            codes, n_vocab = np.arange(n.sum()) % 5, 5 + np.arange(n.sum()) % 3
            random, texts, shown = Stream(1, 2), [], codes.copy()
            for clip, start in enumerate(np.cumsum(n) - n):
                texts.append(random.unit() < 0.5)
                for i in range(start, start + n[clip]):
                    if random.unit() < share:
                        shown[i] = random.below(int(n_vocab[i]))
            found = corrupted(Stream(1, 2), codes, n, n_vocab, 0.5, share)
            np.testing.assert_array_equal(found.without_text, texts)
            np.testing.assert_array_equal(found.codes, shown)

    def test_codes_are_hidden_as_one_by_one(self):
        rng = np.random.default_rng(0)
        n = rng.integers(1, 20, 40)
        first = np.where(rng.random(40) < 0.7, 0, rng.integers(0, n))
        last = np.where(first == 0, n, rng.integers(first, n) + 1)
        parts = Parts(np.arange(40), np.arange(40), first, last)
        codes = rng.integers(0, 5, n.sum())
        for share in (0.0, 0.4):
            random, after = Stream(4, 5), Stream(4, 5)
            clips = zip(np.split(codes, np.cumsum(n)), first, last)
            expected = [_hidden(random, *clip, share) for clip in clips]
            found = hidden(after, codes, n, parts, 5, 0.3, share)
            for own, each in zip(found, zip(*expected)):
                np.testing.assert_array_equal(own, np.hstack(each))
            self.assertEqual(after.unit(), random.unit(), "the stream goes on where it should")

    def test_drawn_places_are_those_of_a_shuffle(self):
        numbers = Stream(0, 0).take(7)
        found = hidden_codes(numbers, np.array([0, 3]), np.array([9, 4]), np.array([3, 4]))
        expected = np.isin(np.arange(9), Stream(0, 0).distinct(9, 3))
        np.testing.assert_array_equal(found, [*expected, *[True] * 4])


def _hidden(random, codes, first, last, share):
    """A clip of which codes are hidden, as the built-in trainer draws it."""
    without_text = random.unit() < 0.3
    part = np.cos(np.pi / 2 * random.unit())
    places = sorted(random.distinct(len(codes), min(max(round(part * len(codes)), 1), len(codes))))
    shown, is_target = codes.copy(), np.zeros(len(codes), bool)
    shown[places] = 5
    targets = [place for place in places if first <= place < last] or [first]
    for place in targets:
        is_target[place], shown[place] = True, 5
        if random.unit() < share:
            shown[place] = random.below(5)
    return without_text, is_target, shown


class Resampling(unittest.TestCase):
    def test_three_bins_of_49_latents_overlap_by_one(self):
        table = area_down(3, 49)
        bins = [(int(row.nonzero()[0][0]), int(row.nonzero()[0][-1]) + 1) for row in table]
        self.assertEqual(bins, [(0, 17), (16, 33), (32, 49)])
        np.testing.assert_allclose(table.sum(1), 1, atol=1e-6)
        np.testing.assert_array_equal(area_down(4, 2) @ [1, 3], [1, 1, 3, 3])

    def test_a_line_through_three_latents_is_met_at_seven_places(self):
        places = linear_up(7, 3) @ [0, 1, 2]
        np.testing.assert_allclose(places, [0, 0.1429, 0.5714, 1, 1.4286, 1.8571, 2], atol=1e-4)
        np.testing.assert_array_equal(linear_up(3, 1), [[1]] * 3)

    def test_clips_side_by_side_have_the_inputs_that_each_has_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            spec = _spec(folder, "scalewise", CODES, MULTISCALE)
            inputs = objective(spec).model.inputs
        latents, n = torch.tensor([1, 3, 6, 4]), 7
        ids = torch.randint(0, 18, (4 * n,), generator=torch.Generator().manual_seed(0))
        ids = ids % 6 + torch.tensor([0, 6, 6, 12, 12, 12, 12]).repeat(4)
        found = inputs(ids, torch.arange(4) * n, latents, torch.float32).unflatten(0, (4, 6))
        for clip, t in enumerate(latents.tolist()):
            alone = _shortened(inputs, t)(ids, torch.tensor([clip * n]), torch.tensor([t]), torch.float32)
            torch.testing.assert_close(found[clip], alone, rtol=1e-5, atol=1e-6)


def _shortened(inputs, t):
    """The same for clips of at most so many latents."""
    short = Multiscale.__new__(Multiscale)
    torch.nn.Module.__init__(short)
    short.scales, short.mix, short.latents = inputs.scales, inputs.mix, t
    for name, buffer in inputs.named_buffers():
        kept = {"up": buffer[: t + 1, :t], "down": buffer[: t + 1, ..., :t]} if buffer.dim() == 3 else {}
        short.register_buffer(name, kept.get(name.split("_")[0], buffer))
    return short


class Padding(unittest.TestCase):
    """A batch that is padded to a fixed size has the loss and the gradients of the batch as it is."""

    def test_autoregressive(self):
        self._check("autoregressive", LAYERS[:1], None)

    def test_scales_of_fixed_lengths(self):
        self._check("scalewise", CODES, MULTISCALE)

    def test_layers_of_one_length(self):
        self._check("scalewise", LAYERS, RESIDUAL)

    def test_one_scale(self):
        self._check("scalewise", LAYERS[:1], {"kind": "vq", "n_vocab": 6})

    def test_hidden_codes(self):
        self._check("masked", LAYERS[:1], None)

    def test_two_stages(self):
        self._check("masked", LAYERS, None)

    def test_two_stages_with_tied_embeddings(self):
        self._check("masked", LAYERS, None, tie_embeddings=True)

    def test_a_head_that_a_step_asks_nothing_of_stays_as_it_is(self):
        ends, idle = [], 0
        for is_padded in (False, True):
            with tempfile.TemporaryDirectory() as folder:
                run = objective(_spec(folder, "masked", LAYERS, None, batch_tokens=4))
                _fill(run.model)
                learning, room = Learning(run, torch.device("cpu"), folder, False), {}
            learning.compiled, learning.adam.param_groups[0]["lr"] = is_padded, 0.1
            batches = [run.batch(step) for step in range(8)]
            for packed in batches:
                room = room_for(packed.sizes(), room)
            for packed in batches:
                idle += any(n == 0 for name, n in packed.sizes().items() if "target" in name)
                learning.update(on_device(_padded(packed, room) if is_padded else packed.as_it_is(), "cpu"))
            ends.append([param.detach() for param in learning.params])
        self.assertGreater(idle, 0)
        for a, b in zip(*ends):
            torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5)

    def _check(self, kind, lengths, quantizer, **shape):
        with tempfile.TemporaryDirectory() as folder:
            run = objective(_spec(folder, kind, lengths, quantizer, **shape))
        _fill(run.model)
        for step in range(3):
            packed = run.batch(step)
            plain, own = self._gradients(run.model, packed.as_it_is())
            padded, others = self._gradients(run.model, _padded(packed, room_for(packed.sizes(), {})))
            self.assertAlmostEqual(plain, padded, places=5)
            for a, b in zip(own, others):
                torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-6)
        with torch.no_grad():
            loss = split_loss(run, "cpu", "val")
        self.assertTrue(np.isfinite(loss["loss_nats"]))
        self.assertEqual([clip["targets"] for clip in loss["clips"]], run.codes.n_targets("val").tolist())
        self.assertEqual(len(loss["normalised_by_scale"]), len(lengths) if len(lengths) > 1 else 0)
        self.assertEqual(len(loss["likeliest_exponential_entropy"]), len(lengths))

    def _gradients(self, model, arrays):
        model.zero_grad(set_to_none=True)
        loss = model(on_device(arrays, "cpu"))
        loss.backward()
        grads = [torch.zeros_like(own) if own.grad is None else own.grad for own in model.parameters()]
        return loss.item(), grads


def _fill(model):
    random = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for param in model.parameters():
            param.normal_(0, 0.3, generator=random)


def _padded(packed, room):
    """A padded batch with the grid of its rows, so that attention goes sequence by sequence."""
    arrays, plain = packed.padded(room), packed.as_it_is()
    for name in [name for name in plain if name.endswith("grid_at")]:
        rows = len(arrays[name.replace("grid_at", "first")])
        arrays[name] = np.concatenate([plain[name], np.zeros(rows - len(plain[name]), np.int64)])
        arrays[name[:-3]] = plain[name[:-3]]
    return arrays


def _spec(folder, kind, lengths, quantizer, tie_embeddings=False, batch_tokens=41):
    """A run on a made-up data set whose files lie in a folder."""
    rng = np.random.default_rng(0)
    grid = {"scales": [{"n_vocab": 6, "length": own} for own in lengths]}
    grid["end_token"] = kind == "autoregressive"
    shape = {"n_layer": 1, "n_head": 2, "d_model": 8, "d_ff": 12, "n_ctx": MAX_TEXT + 3 * MOST_LATENTS}
    shape |= {"d_text": D_TEXT, "ffn": "gelu", "tie_embeddings": tie_embeddings, "rope_base": 100.0}
    if "codes" in lengths[0]:
        shape["n_ctx"] = MAX_TEXT + 7
    if len(lengths) == 1:
        shape["n_ctx"] = MAX_TEXT + MOST_LATENTS
    generator = {"kind": kind, "shape": shape, "d_latent": D_LATENT, "frames_per_latent": 4}
    generator |= {"most_latents": MOST_LATENTS, "corruption": 0.3, "text_drop": 0.3}
    spec = {"generator": generator, "shape": shape, "grid": grid, "seed": 2, "clips": None, "captions": "drawn"}
    spec |= {"batch_tokens": batch_tokens, "steps": 8, "precision": "f32", "clip_norm": 1.0}
    spec |= {"betas": [0.9, 0.99], "epsilon": 1e-8, "weight_decay": 0.1}
    spec |= {"targets_per_pass": 64, "tokenizer": folder}
    spec |= {name: os.path.join(folder, f"{name}.safetensors") for name in ("codes", "text")}
    _write_codes(spec["codes"], grid, rng)
    _write_captions(spec["text"], rng)
    if quantizer is not None:
        _write_tokenizer(folder, quantizer, rng)
    path = os.path.join(folder, "spec.json")
    with open(path, "w") as file:
        json.dump(spec, file)
    return RunSpec(path)


def _write_codes(path, grid, rng):
    arrays = {}
    for split in ("train", "val", "test"):
        frames = rng.integers(1, MOST_LATENTS + 1, 9) * 4
        lengths = [own["length"] for own in grid["scales"]]
        n = sum(frames // 4 if "frames_per_code" in own else frames * 0 + own["codes"] for own in lengths)
        offsets = np.concatenate([[0], np.cumsum(n)])
        arrays[f"{split}.codes"] = rng.integers(0, 6, offsets[-1]).astype(np.uint32)
        arrays[f"{split}.offsets"] = offsets.astype(np.uint64)
        arrays[f"{split}.frames"] = frames.astype(np.uint64)
    save_file(arrays, path, {"grid": json.dumps(grid)})


def _write_captions(path, rng):
    words = np.concatenate([[0], np.cumsum(rng.integers(1, MAX_TEXT + 1, 12))])
    arrays = {"embeddings": rng.standard_normal(words[-1] * D_TEXT).astype(np.float32)}
    arrays["words"] = words.astype(np.uint64)
    for split in ("train", "val", "test"):
        offsets = np.concatenate([[0], np.cumsum(rng.integers(1, 3, 9))])
        arrays[f"{split}.captions"] = rng.integers(0, 12, offsets[-1]).astype(np.uint32)
        arrays[f"{split}.offsets"] = offsets.astype(np.uint64)
    save_file(arrays, path, {"dim": str(D_TEXT)})


def _write_tokenizer(folder, quantizer, rng):
    def values(*shape):
        return rng.standard_normal(shape).astype(np.float32)

    arrays, books = {}, range(3)
    if quantizer["kind"] == "multiscale":
        quantizer = quantizer | {"codebooks": [{"kind": "vq", "n_vocab": 6}] * 3}
        own = "quantizer.Multiscale"
        arrays |= {f"{own}.codebooks.{n}.Vq.codebook": values(6, D_LATENT) for n in books}
        for name in (f"{own}.smoothings.{n}.convolutions.{i}.affine" for n in books for i in range(2)):
            arrays |= {f"{name}.weight": values(3 * D_LATENT, D_LATENT), f"{name}.bias": values(D_LATENT)}
    else:
        arrays |= {f"quantizer.ResidualVq.layers.{n}.codebook": values(6, D_LATENT) for n in books}
    save_file(arrays, os.path.join(folder, "weights.safetensors"))
    with open(os.path.join(folder, "tokenizer.json"), "w") as file:
        json.dump({"quantizer": quantizer}, file)


if __name__ == "__main__":
    unittest.main()
