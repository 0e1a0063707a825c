"""The loop: steps, the optimiser, the average of the weights, checkpoints and progress."""

import json
import math
import os
import signal
import time

import torch
from torch import nn

from .. import learning as shared
from ..store import Captions
from . import convolutional, transformer
from .losses import FeatureLoss, JointLoss
from .noise import Noise
from .quantizer import codebooks, only, quantized, quantizer
from .transformer import Said
from .windows import CaptionsOfSteps, Pool, Windows


class Tokenizer(nn.Module):
    """Encoder, quantizer and decoder, under the names of the built-in trainer."""

    def __init__(self, spec, n_features):
        super().__init__()
        kind, name = (transformer, "Transformer") if spec.is_transformer else (convolutional, "Convolutional")
        self.encoder = nn.ModuleDict({name: kind.Encoder(spec.architecture, n_features)})
        self.quantizer = quantizer(spec)
        self.decoder = nn.ModuleDict({name: kind.Decoder(spec.architecture, n_features)})

    def forward(self, x, said, noise):
        """What is made of windows `[b, t, f]`, and the quantizer's own loss or None."""
        latents = only(self.encoder)(x, said, noise)
        codes, loss = quantized(self.quantizer, latents)
        return only(self.decoder)(codes, x.shape[1], said, noise), loss


class Learning:
    """A tokenizer from its first step, or its checkpoint, to its last."""

    def __init__(self, spec, first, device, checkpoint):
        self.spec, self.device, self.path = spec, device, os.path.join(checkpoint, "state.pt")
        pool = Pool(spec.pool, device)
        self.windows = Windows(spec, pool, device)
        self.captions = CaptionsOfSteps(spec, Captions(spec.text), device) if spec.language else None
        self.model = Tokenizer(spec, len(pool.mean))
        self.model.load_state_dict(first)
        self.model.to(device)
        self.loss = (JointLoss if spec.by_joints else FeatureLoss)(spec, pool)
        self.params = list(self.model.parameters())
        averages = spec.training["average"] > 0.0
        self.average = [param.detach().clone() for param in self.params] if averages else None
        self.adam = self._optimiser()
        self.step, self.read, self.wall_s, self.stopped = 0, 0, 0.0, False
        self.losses = torch.zeros(spec.steps, device=device)

    def _optimiser(self):
        training = self.spec.training
        betas = training["beta_1"], training["beta_2"]
        decay = training["weight_decay"]
        return torch.optim.AdamW(self.params, lr=0.0, betas=betas, eps=1e-8, weight_decay=decay, fused=True)

    def compile(self):
        """Compiles both halves for the card, with products in TF32."""
        torch.set_float32_matmul_precision("high")
        only(self.model.encoder).compile()
        only(self.model.decoder).compile()

    def run(self):
        """Takes the steps that are left."""
        self._resume()
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._stop)
        began, before = time.monotonic(), self.wall_s
        told = saved = began
        every = self.spec.checkpoint_s
        while self.step < self.spec.steps:
            self._take()
            now, last = time.monotonic(), self.step == self.spec.steps
            self.wall_s = before + now - began
            stopped = self.stopped and not last
            if last or stopped or now - told >= shared.TELL_S or now - saved >= every:
                told = now
                self._tell()
            if stopped or now - saved >= every:
                saved = self._save()
                every = max(self.spec.checkpoint_s, (saved - now) / shared.CHECKPOINT_SHARE)
            if stopped:
                place = f"step {self.step} of {self.spec.steps}"
                raise shared.Stopped(f"stopped at {place}; its checkpoint is written")

    def _stop(self, *_):
        self.stopped = True

    def _take(self):
        """One step."""
        for group in self.adam.param_groups:
            group["lr"] = self.spec.learning_rate(self.step)
        self.adam.zero_grad(set_to_none=True)
        loss = self._loss()
        loss.backward()
        self._clip()
        self._count_steps()
        self.adam.step()
        self.losses[self.step] = loss.detach()
        self.step += 1
        self._follow()

    def _count_steps(self):
        """Bias is corrected by the steps of the training, also of a layer that some steps show no word."""
        if self.captions is not None:
            for state in self.adam.state.values():
                state["step"].fill_(self.step)

    def _loss(self):
        truth, visible, clips = self.windows.of(self.step)
        said = Said(*self.captions.of(self.step, clips)) if self.captions else None
        made, own = self.model(truth, said, Noise(self.spec.seed, self.step))
        loss = self.loss(made, truth, visible)
        return loss if own is None else loss + own

    def _clip(self):
        """Scales gradients down to the norm of the spec; 0 is none."""
        limit = self.spec.training["clip_norm"]
        if limit > 0.0:
            grads = [param.grad for param in self.params if param.grad is not None]
            norm = torch.linalg.vector_norm(torch.stack(torch._foreach_norm(grads)))
            torch._foreach_mul_(grads, (limit / norm).clamp(max=1.0))

    @torch.no_grad()
    def _follow(self):
        """The moving average of the weights takes in those after the step."""
        if self.average is not None:
            decay = min(self.spec.training["average"], self.step / (self.step + 9))
            torch._foreach_mul_(self.average, decay)
            torch._foreach_add_(self.average, self.params, alpha=1.0 - decay)

    def kept(self):
        """The weights that are kept, by name: averaged ones if the spec averages; codes are never averaged."""
        state = self.model.state_dict()
        if self.average is not None:
            names = [name for name, _ in self.model.named_parameters()]
            state |= dict(zip(names, self.average))
        return state

    def _tell(self):
        """A line of progress. Reads the losses since the last one, and ends a run whose loss is no number."""
        steps = self.spec.steps
        losses = self.losses[self.read : self.step].tolist()
        for step, loss in enumerate(losses, self.read + 1):
            if not math.isfinite(loss):
                advice = "lower tokenizer.lr, and look for features that are not finite"
                raise shared.Failed(f"the loss is {loss} at step {step} of {steps}: {advice}")
        self.read = self.step
        print(json.dumps({"step": self.step, "steps": steps, "loss": losses[-1]}), flush=True)

    def _save(self):
        """Writes a checkpoint; when it was written."""
        state = {"step": self.step, "model": self.model.state_dict(), "adam": self.adam.state_dict()}
        state |= {"average": self.average, "losses": self.losses, "wall_s": self.wall_s}
        state["codebooks"] = [own.state() for own in codebooks(self.model.quantizer)]
        shared.save_state(self.path, state)
        return time.monotonic()

    def _resume(self):
        state = shared.load_state(self.path, self.device)
        if state is None:
            return
        self.model.load_state_dict(state["model"])
        self.adam.load_state_dict(state["adam"])
        for own, kept in zip(codebooks(self.model.quantizer), state["codebooks"]):
            own.resume(kept)
        self.average, self.losses, self.wall_s = state["average"], state["losses"], state["wall_s"]
        self.step = self.read = state["step"]
        print(f"going on from step {self.step}", flush=True)
