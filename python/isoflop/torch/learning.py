"""The loop: steps, the optimiser, checkpoints, progress, and the end of a run."""

import errno
import json
import math
import os
import queue
import shutil
import signal
import threading
import time

import numpy as np
import torch

from .ends import Failed, Stopped
from .packing import on_device, room_for
from .track import tracker

# Between two lines of progress, in seconds; losses are read from the device as often.
TELL_S = 0.5
# A training loss so many nats above the uniform model's ends the run.
DIVERGED_NATS = 3.0
# A disk with so few bytes left is full; numbers of the system that say the same.
LEAST_FREE, NO_ROOM = 1 << 20, (errno.EFBIG, errno.ENOSPC, errno.EDQUOT)
# A checkpoint may take this share of the time.
CHECKPOINT_SHARE = 0.05


class Learning:
    """A run from its first step, or its checkpoint, to its last."""

    def __init__(self, objective, device, checkpoint, compiled):
        self.objective, self.spec, self.device = objective, objective.spec, device
        self.path = os.path.join(checkpoint, "state.pt")
        self.model = objective.model.to(device)
        self.model.dtype = {"f32": torch.float32, "bf16": torch.bfloat16}[self.spec.precision]
        self.params = list(self.model.parameters())
        self.compiled = compiled
        rate = torch.zeros((), device=device) if compiled else 0.0
        self.adam = torch.optim.AdamW(
            self.params,
            lr=rate,
            betas=tuple(self.spec.betas),
            eps=self.spec.epsilon,
            weight_decay=self.spec.weight_decay,
            fused=True,
            capturable=compiled,
        )
        for param in self.params:
            # Made here, since a head that the first steps ask nothing of would begin to count at its own first.
            count = torch.zeros((), device=device)
            moments = {name: torch.zeros_like(param) for name in ("exp_avg", "exp_avg_sq")}
            self.adam.state[param] = {"step": count, **moments}
        self.step = 0
        # The loss of each step since the last line of the log, in nats.
        self.losses, self.read = torch.zeros(self.spec.steps, device=device), 0
        self.totals = {"wall_s": 0.0, "forward_flops": 0.0, "log": [], "loss_sum": 0.0, "loss_count": 0}
        self.stopped = False
        self.tracker = tracker(self.spec)
        self.stepper = Stepper(self) if compiled else None

    def run(self):
        """Takes the steps that are left."""
        self._resume()
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._stop)
        began, first = time.monotonic(), self.step
        before, told, saved = self.totals["wall_s"], began, began
        every = self.spec.checkpoint_s
        for packed in prefetched(self.objective, self.step, self.spec.steps):
            self.totals["forward_flops"] += packed.forward_flops
            self._take(packed)
            self.step += 1
            now, due = time.monotonic(), self.spec.is_due(self.step)
            self.totals["wall_s"] = before + now - began
            last = self.step == self.spec.steps
            if due or last or self.stopped or now - told >= TELL_S or now - saved >= every:
                told = now
                loss = self._look()
                self._tell(loss, self.step - first, time.monotonic() - began)
            if due:
                self._measure()
            if self.stopped and not last or now - saved >= every:
                saved = self._save()
                every = max(self.spec.checkpoint_s, (saved - now) / CHECKPOINT_SHARE)
            if self.stopped and not last:
                raise Stopped(f"stopped at step {self.step} of {self.spec.steps}; its checkpoint is written")

    def _stop(self, *_):
        self.stopped = True

    def _take(self, packed):
        """One step."""
        rate = self.spec.learning_rate(self.step)
        if self.stepper is not None:
            self.stepper.take(packed, rate)
            return
        for group in self.adam.param_groups:
            group["lr"] = rate
        batch = on_device(packed.as_it_is(), self.device)
        self.losses[self.step] = self.update(batch)

    def update(self, batch):
        """Gradients of a batch, clipped, and the step of the optimiser; the loss before it."""
        self.adam.zero_grad(set_to_none=True)
        loss = self.model(batch)
        loss.backward()
        grads = [param.grad for param in self.params if param.grad is not None]
        if self.spec.clip_norm is not None:
            norm = torch.linalg.vector_norm(torch.stack(torch._foreach_norm(grads)))
            torch._foreach_mul_(grads, (self.spec.clip_norm / norm).clamp(max=1.0))
        self._count_steps()
        optional = [(asked, tensor, tensor.clone()) for asked, tensor in self._optional(batch)]
        self.adam.step()
        for asked, tensor, before in optional:
            tensor.copy_(torch.where(asked, tensor, before))
        return loss.detach()

    def _optional(self, batch):
        """Heads and their moments, each with whether the batch asks anything of it: if not, the step leaves it
        as it is. Batches are padded only when steps are compiled; they give an idle head a gradient of zero, by
        which its moments would decay."""
        for asked, param in self.model.optional(batch) if self.compiled else []:
            if param.grad is not None:
                state = self.adam.state[param]
                for tensor in (param.data, state["exp_avg"], state["exp_avg_sq"]):
                    yield asked, tensor

    def _count_steps(self):
        """Bias is corrected by the steps of the run, also of a head that this step asks nothing of."""
        idle = [self.adam.state[param]["step"] for param in self.params if param.grad is None]
        if idle:
            torch._foreach_add_(idle, 1)

    def _look(self):
        """Reads the losses of the steps since it last did, and ends a run that has diverged."""
        losses = self.losses[self.read : self.step].double().cpu().numpy()
        steps, ignorant = self.spec.steps, self.objective.uniform_nats
        for step, loss in enumerate(losses, self.read + 1):
            if not math.isfinite(loss):
                raise Failed(f"the loss is {loss} at step {step} of {steps}: lower train.lr")
            if loss > ignorant + DIVERGED_NATS:
                raise Failed(
                    f"diverged: the loss is {loss:.2f} at step {step} of {steps}, {ignorant:.2f} would be "
                    "knowing nothing: lower train.lr"
                )
        self.totals["loss_sum"] += float(losses.sum())
        self.totals["loss_count"] += len(losses)
        self.read = self.step
        return float(losses[-1])

    def _tell(self, loss, steps, seconds):
        """A line of progress: tokens a second by what this process has done, and the share of the card's peak by
        the plan's FLOPs."""
        spec = self.spec
        tokens_per_s = steps * spec.batch_tokens / seconds
        line = {"step": self.step, "steps": spec.steps, "loss": loss, "train_s": seconds}
        line["tokens_per_s"] = round(tokens_per_s)
        peak = peak_flops(self.device, spec.peak_flops)
        if peak is not None:
            line["mfu"] = round(tokens_per_s * spec.budget_flops / spec.tokens / peak, 4)
        print(json.dumps(line), flush=True)
        names = {"loss": "loss_nats", "tokens_per_s": "tokens_per_s", "mfu": "mfu"}
        self.tracker.log(self.step, {f"train/{names[key]}": line[key] for key in names if key in line})

    def _measure(self):
        """A line of the log: the loss on the validation split."""
        totals, spec = self.totals, self.spec
        loss = self.measured("val")["loss_normalised"]
        line = {"step": self.step, "tokens": self.step * spec.batch_tokens}
        line["lr"] = spec.learning_rate(self.step - 1)
        line["train_loss_nats"] = totals["loss_sum"] / max(1, totals["loss_count"])
        totals["log"].append(line | {"val_loss_normalised": loss})
        self.tracker.log(self.step, {"train/lr": line["lr"], "val/loss_normalised": loss})
        totals["loss_sum"], totals["loss_count"] = 0.0, 0

    def measured(self, split):
        """The loss on a split, in single precision."""
        model, before = self.model, self.model.dtype
        model.dtype = torch.float32
        try:
            with torch.no_grad():
                loss = split_loss(self.objective, self.device, split)
        finally:
            model.dtype = before
        if not math.isfinite(loss["loss_nats"]):
            raise Failed(f"the loss is {loss['loss_nats']} at step {self.step} of {self.spec.steps}: lower train.lr")
        return loss

    def _save(self):
        """Writes a checkpoint; when it was written."""
        state = {"step": self.step, "model": self.model.state_dict(), "adam": self.adam.state_dict()}
        save_state(self.path, state | {"totals": self.totals})
        return time.monotonic()

    def _resume(self):
        state = load_state(self.path, self.device)
        if state is None:
            return
        self.model.load_state_dict(state["model"])
        self.adam.load_state_dict(state["adam"])
        self.step = self.read = state["step"]
        self.totals = state["totals"]
        print(f"going on from step {self.step}", flush=True)


def save_state(path, state):
    """A checkpoint, whole, by rename."""
    partial = path + ".partial"
    try:
        torch.save(state, partial)
        os.replace(partial, path)
    except (OSError, RuntimeError) as error:
        is_full = shutil.disk_usage(os.path.dirname(path)).free < LEAST_FREE
        kind = "disk-full" if is_full or getattr(error, "errno", None) in NO_ROOM else "other"
        raise Failed(f"the checkpoint {path} cannot be written: {error}", kind) from error


def load_state(path, device):
    """The checkpoint, or None where there is none. One that cannot be read is set aside."""
    if not os.path.exists(path):
        return None
    try:
        return torch.load(path, map_location=device, weights_only=True)
    except torch.OutOfMemoryError:
        raise
    except Exception as error:
        os.replace(path, path + ".damaged")
        print(f"warning: {path} cannot be read, and training begins anew: {error}", flush=True)
        return None


class Stepper:
    """Steps on a GPU: compiled, and replayed as one graph of kernels.

    Batches are padded to one size; a batch that does not fit makes all later ones larger.
    """

    def __init__(self, learning):
        self.learning, self.room, self.graph = learning, {}, None
        learning.model.compile_parts()

    def take(self, packed, rate):
        """One step of a batch at a learning rate."""
        learning, room = self.learning, room_for(packed.sizes(), self.room)
        arrays = packed.padded(room)
        flat = torch.from_numpy(np.concatenate(list(arrays.values()))).pin_memory()
        if room != self.room:
            self.room = room
            self._record(arrays, flat)
        self.flat.copy_(flat, non_blocking=True)
        self.rate.fill_(rate)
        self.graph.replay()
        learning.losses[learning.step] = self.loss

    def _record(self, arrays, flat):
        """Records a step on batches of one size. Recording takes a few steps to warm up, whose effect is
        undone."""
        learning = self.learning
        self.flat, self.rate = flat.to(learning.device), learning.adam.param_groups[0]["lr"]
        ends = np.cumsum([len(array) for array in arrays.values()]).tolist()
        starts = [0, *ends[:-1]]
        batch = {name: self.flat[a:b] for name, a, b in zip(arrays, starts, ends)}
        state = self._state()
        kept = [tensor.cpu() for tensor in state]
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                learning.update(batch)
        torch.cuda.current_stream().wait_stream(side)
        self.graph = torch.cuda.CUDAGraph()
        learning.adam.zero_grad(set_to_none=True)
        with torch.cuda.graph(self.graph):
            self.loss = learning.update(batch)
        for tensor, before in zip(state, kept):
            tensor.copy_(before)

    def _state(self):
        """All that a step changes: parameters, moments and steps."""
        adam = self.learning.adam
        moments = [own for param in self.learning.params for own in adam.state[param].values()]
        return [param.data for param in self.learning.params] + moments


def prefetched(objective, first, last, ahead=8):
    """The batches of steps, packed by a thread a few steps ahead."""
    found = queue.Queue(ahead)

    def pack():
        try:
            for step in range(first, last):
                found.put(objective.batch(step))
        except BaseException as error:  # told where batches are taken
            found.put(error)

    threading.Thread(target=pack, daemon=True).start()
    for _ in range(first, last):
        packed = found.get()
        if isinstance(packed, BaseException):
            raise packed
        yield packed


def peak_flops(device, peaks):
    """Of the card, by a word of its name; None for one that is not known."""
    if device.type != "cuda":
        return None
    words = torch.cuda.get_device_name(device).replace("-", " ").split()
    return next((peak for word, peak in peaks.items() if word in words), None)


def split_loss(objective, device, split):
    """Cross-entropy and L_u on a split, of each scale and of each clip, each clip once with one caption; and the
    exponential entropy of each scale's likeliest codes."""
    n_clips, n_scales = objective.codes.n_clips(split), len(objective.codes.scales)
    clips, scales = np.zeros((n_clips, 3)), np.zeros((n_scales, 3))
    used = np.zeros((n_scales, objective.codes.n_vocab + 1))
    for some in passes(objective.codes.n_targets(split), objective.spec.targets_per_pass):
        for nll, unigram, clip, scale, likeliest in objective.measured(split, some, device):
            np.add.at(used, likeliest, 1)
            own = np.stack([nll, unigram, np.ones_like(nll)], 1)
            np.add.at(clips, clip, own)
            np.add.at(scales, scale, own)
    nats, unigram, targets = scales.sum(0).tolist()
    frames = int(objective.codes.frames[split].sum())
    by_scale = [(a - b) / n for a, b, n in scales if n > 0]
    return {
        "loss_nats": nats / targets,
        "loss_normalised": (nats - unigram) / targets,
        "nats_per_frame": nats / frames,
        "normalised_by_scale": by_scale if len(by_scale) > 1 else [],
        "likeliest_exponential_entropy": [exponential_entropy(counts[counts > 0]) for counts in used],
        "clips": [{"nats": a, "unigram_nats": b, "targets": int(n)} for a, b, n in clips],
    }


def exponential_entropy(counts):
    """How many values of like frequency have the entropy of these counts."""
    shares = counts / counts.sum()
    return float(np.exp(-(shares * np.log(shares)).sum()))


def passes(targets, most):
    """Clips that are measured together: at most so many targets, or one clip."""
    some, total = [], 0
    for clip, own in enumerate(targets.tolist()):
        if some and total + own > most:
            yield np.array(some)
            some, total = [], 0
        some.append(clip)
        total += own
    if some:
        yield np.array(some)
