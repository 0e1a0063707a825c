"""Codes that have a head for each of their scales or layers."""

import numpy as np
import torch

from .network import Network


def targets_by_head(head, rows, codes, n_heads):
    """The groups `target_0`, `target_1`, ... of a batch: the rows that predict the codes of each head."""
    groups = {}
    for k in range(n_heads):
        own = head == k
        arrays = {"rows": rows[own], "targets": codes[own], "valid": np.ones(own.sum(), np.int64)}
        groups[f"target_{k}"] = {f"{name}_{k}": array for name, array in arrays.items()}
    return groups


class Headed(Network):
    """A network with several heads: `classes` gives them, `embedded` the rows that the blocks take."""

    PARTS = ("embedded", "heads_loss")

    def optional(self, batch):
        first = self.n_heads - len(self.heads)
        return [(batch[f"valid_{k}"].any(), head) for k, head in enumerate(self.heads, first)]

    def features(self, batch):
        """What the blocks make of the rows that predict targets, head after head, `[s, d]` each."""
        x = self.stacked(self.part("embedded")(batch), batch)
        rows = [batch[f"rows_{k}"] for k in range(self.n_heads)]
        return x[torch.cat(rows)].split([len(own) for own in rows])

    def forward(self, batch):
        """Mean cross-entropy of all targets of a batch, in nats."""
        return self.part("heads_loss")(self.features(batch), batch)

    def heads_loss(self, features, batch):
        """The sum over heads; a head that nothing is asked of has no gradient."""
        n_targets = sum(batch[f"valid_{k}"].sum() for k in range(self.n_heads))
        loss = 0.0
        for k, (x, head) in enumerate(zip(features, self.classes())):
            if len(x) > 0:
                weights = batch[f"valid_{k}"] / n_targets
                loss = loss + self.head_loss(x, head, batch[f"targets_{k}"], weights)
        return loss

    def target_nll(self, batch):
        """-ln p of the targets of each head, in nats, and the likeliest codes in their places."""
        found = zip(self.features(batch), self.classes(), range(self.n_heads))
        return [self.head_nll(x, head, batch[f"targets_{k}"]) for x, head, k in found]


def table_rows(table, at):
    """Rows of a small table, `[n, d]`, zeros where `at` is -1: as a product, whose gradient a GPU sums faster
    than that of a lookup with many rows alike."""
    places = torch.arange(len(table), device=table.device)
    return (at[:, None] == places).to(table.dtype) @ table
