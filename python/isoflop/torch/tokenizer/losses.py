"""What training makes small.

Shapes: b windows, t frames, f features, j joints.
"""

import torch
import torch.nn.functional as F

ROOT_YAW, POSITIONS = 0, slice(4, 67)
# Metres, and metres a frame, that count as one.
DISTANCE_M, VELOCITY_M = 0.1, 0.02
# Keeps the distance's gradient finite at 0, in square metres.
SOFTENING_M2 = 1e-6
# How much the turn, the rest of the root and each other feature count for.
TURN, ROOT, OTHER = 12.0, 6.0, 1.0


class FeatureLoss:
    """Smooth L1 over all features, and over the positions once more, each a mean over its own (T2M-GPT)."""

    def __init__(self, spec, pool):
        n, positions = len(pool.mean), len(pool.mean[POSITIONS])
        shares = torch.full((n,), 1.0 / n, dtype=torch.float64)
        shares[POSITIONS] += spec.training["position_weight"] / max(1, positions)
        self.shares = shares.float().to(pool.mean.device)

    def __call__(self, made, truth, visible):
        b, t, _ = made.shape
        return (F.smooth_l1_loss(made, truth, reduction="none") * (self.shares / (b * t))).sum()


class JointLoss:
    """Distances of the joints in metres, with the true heading and with the tokenizer's own, beside the features
    and the joints' velocities; in double precision, as the built-in trainer computes it."""

    def __init__(self, spec, pool):
        training, self.mean, self.std = spec.training, pool.mean.double(), pool.std.double()
        self.velocity_weight = training["velocity_weight"]
        shares = torch.full_like(self.mean, OTHER)
        shares[: POSITIONS.start], shares[ROOT_YAW] = ROOT, TURN
        self.shares = training["feature_weight"] * shares / shares.sum()

    def __call__(self, made, truth, visible):
        made, truth, visible = made.double(), truth.double(), visible.double()
        features = F.smooth_l1_loss(made, truth, reduction="none") @ self.shares
        loss = ((features + self._distances(made, truth)) * visible).sum()
        both = visible[:, 1:] * visible[:, :-1]
        loss = loss + (self._velocities(made, truth) * both).sum()
        return (loss / visible.sum()).float()

    def _positions(self, x):
        """Of the joints about the root, in metres, `[b, t, j, 3]`."""
        return (x[..., POSITIONS] * self.std[POSITIONS] + self.mean[POSITIONS]).unflatten(-1, (-1, 3))

    def _distances(self, made, truth):
        """Half of each distance's mean over the joints, in units, `[b, t]`."""
        off = (made[..., ROOT_YAW] - truth[..., ROOT_YAW]) * self.std[ROOT_YAW]
        # The turns before a frame.
        angle = -2.0 * (off.cumsum(1) - off)
        made, truth = self._positions(made), self._positions(truth)
        cos, sin = angle.cos()[..., None], angle.sin()[..., None]
        x, y, z = made.unbind(-1)
        turned = torch.stack([cos * x + sin * z, y, cos * z - sin * x], -1)
        both = length(made - truth) + length(turned - truth)
        return 0.5 / DISTANCE_M * both.mean(-1)

    def _velocities(self, made, truth):
        """How far off the velocities are that lead to the second frame and all later ones, `[b, t - 1]`."""
        apart = self._positions(made) - self._positions(truth)
        return self.velocity_weight / VELOCITY_M * apart.diff(dim=1).abs().mean((-1, -2))


def length(apart):
    return (apart.square().sum(-1) + SOFTENING_M2).sqrt()
