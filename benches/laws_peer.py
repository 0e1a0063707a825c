"""isoflop's fits beside what public analyses do, on the same data: `just bench-laws-peer`.

Usage: python3 benches/laws_peer.py target/release/isoflop [--share 0.1] [--rounds 5] [--only NAME]

Each analysis is written anew from its description, with numpy and scipy:

  chinchilla   Besiroglu et al. 2024: BFGS from each of Hoffmann's 4500 starts on the sum of
               Huber(1e-3) of ln L - LSE(a - alpha ln N, b - beta ln D, e), and 4000 bootstrap fits
               from Hoffmann's published law. Their own code differentiates with autograd, which is
               slower than the analytic gradient here.
  vocabulary   Tao et al. 2024: L-BFGS-B from 486 starts, numeric gradients, exponents in [0.1, 1],
               D = H/1e9 f(V/1000).
  collection   Variable projection: E, A, B solved at each point of a 0.01 grid of exponents, first by
               least squares, then reweighted towards Huber(1e-3).

Both run on one core and one thread, in turn, several rounds. Times are processor seconds, which do
not count what else runs on that core. Ours is the whole program, from its start, with the file read
and the laws printed; theirs is the fit alone, without Python's start, imports and reading. --share runs
a random share of their starts or replicates, others each round, and scales their time up; the
objective is then the lowest of those run. Both objectives are computed here, by one function, from the
coefficients.
"""

import argparse
import itertools
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

for name in ("OMP", "OPENBLAS", "MKL", "RAYON"):
    os.environ[f"{name}_NUM_THREADS"] = "1"
os.environ["POLARS_MAX_THREADS"] = "1"

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy.optimize import minimize  # noqa: E402

RUNS = Path(__file__).resolve().parent / "../../shared/data/runs"
DELTA = 1e-3
# ln A, ln B, ln E, alpha, beta of Hoffmann et al. 2022.
PUBLISHED = np.array([np.log(406.4), np.log(410.7), np.log(1.69), 0.34, 0.28])
# Starts within this of the lowest objective have reached it.
REACHED = 1e-4


@dataclass
class Case:
    """One fit, as isoflop does it and as the peer does it."""

    name: str
    # isoflop's arguments.
    ours: list
    # Its objective from its `parametric`; indices of the pieces that the peer ran.
    objective: Callable
    # Runs some pieces (starts, replicates) and gives their objectives.
    peer: Callable
    # How many pieces there are; None where the peer is one piece and is never run in part.
    pieces: int | None
    # One objective of all pieces.
    reduce: Callable = np.min


def huber(residual, delta=DELTA):
    size = np.abs(residual)
    cut = np.minimum(size, delta)
    return cut * (size - 0.5 * cut)


# --- Chinchilla ---------------------------------------------------------------------------------


class Chinchilla:
    """The objective of approach 3 in logarithms, with its gradient."""

    def __init__(self, n, d, loss):
        self.ln_n, self.ln_d, self.ln_loss = np.log(n), np.log(d), np.log(loss)

    def rows(self, drawn):
        part = object.__new__(Chinchilla)
        part.ln_n, part.ln_d, part.ln_loss = self.ln_n[drawn], self.ln_d[drawn], self.ln_loss[drawn]
        return part

    def value(self, theta):
        return self.both(theta)[0]

    def both(self, theta):
        a, b, e, alpha, beta = theta
        terms = np.empty((3, len(self.ln_n)))
        terms[0] = a - alpha * self.ln_n
        terms[1] = b - beta * self.ln_d
        terms[2] = e
        most = terms.max(axis=0)
        terms -= most
        np.exp(terms, out=terms)
        total = terms.sum(axis=0)
        residual = self.ln_loss - most - np.log(total)
        # minus h' times each term's share of the loss
        pull = -np.clip(residual, -DELTA, DELTA) / total
        by_a, by_b = pull * terms[0], pull * terms[1]
        gradient = np.array(
            [by_a.sum(), by_b.sum(), pull @ terms[2], -(by_a @ self.ln_n), -(by_b @ self.ln_d)]
        )
        return huber(residual).sum(), gradient

    def fit(self, start):
        with np.errstate(all="ignore"):
            found = minimize(self.both, start, jac=True, method="BFGS")
        return found.x, found.fun


def of_chinchilla(fitted):
    """Our coefficients as theta."""
    logs = [np.log(fitted[name]) for name in ("A", "B", "E")]
    return np.array([*logs, fitted["alpha"], fitted["beta"]])


def chinchilla_cases():
    path = RUNS / "epoch_chinchilla/svg_extracted_data.csv"
    if absent(path):
        return []
    table = pd.read_csv(path)
    table = table.drop(table["loss"].nlargest(5).index)
    n, compute = table["Model Size"].to_numpy(), table["Training FLOP"].to_numpy()
    problem = Chinchilla(n, compute / (6 * n), table["loss"].to_numpy())
    exponents = np.arange(0, 2.01, 0.5)
    starts = np.array(
        list(
            itertools.product(
                range(0, 26, 5), range(0, 26, 5), np.arange(-1, 1.01, 0.5), exponents, exponents
            )
        ),
        dtype=float,
    )
    np.random.seed(42)
    draws = [np.random.choice(len(n), len(n)) for _ in range(4000)]
    columns = "params=Model Size,budget_flops=Training FLOP,loss=loss"
    ours = [str(path), "--columns", columns, "--compat", "epoch"]

    def from_starts(which):
        return [problem.fit(starts[i])[1] for i in which]

    def replicates(which):
        return [problem.rows(draws[i]).fit(PUBLISHED)[1] for i in which]

    def one(fitted, _):
        return problem.value(of_chinchilla(fitted))

    def of_replicates(fitted, which):
        assert len(fitted["bootstrap"]) == len(draws), "a replicate of ours is missing"
        names = ("E", "A", "B", "alpha", "beta")
        thetas = [of_chinchilla(dict(zip(names, values))) for values in fitted["bootstrap"]]
        return np.mean([problem.rows(draws[i]).value(thetas[i]) for i in which])

    default = ["--starts", "default"]
    return [
        Case("Chinchilla, ours from default starts", [*ours, "--bootstrap", "0", *default],
             one, from_starts, len(starts)),
        Case("Chinchilla, both from 4500 starts", [*ours, "--bootstrap", "0"],
             one, from_starts, len(starts)),
        Case("Chinchilla, 4000 replicates", [*ours, *default],
             of_replicates, replicates, len(draws), np.mean),
    ]


# --- Vocabulary ---------------------------------------------------------------------------------


def vocabulary_cases():
    path = RUNS / "scaling_with_vocab/exp_data.csv"
    if absent(path):
        return []
    table = pd.read_csv(path)
    table = table[table["FLOPs"] >= 2.18e17]
    v = table["vocab_size"].to_numpy()
    nonvocab = table["Non_vocab_parameters"].to_numpy() / 1e6
    vocab = v * table["embed_dim"].to_numpy() / 1e6
    ln_v = np.log(v / 1000)
    per_character = 0.00639222 * ln_v**2 - 0.15811069 * ln_v + 1.20470122
    tokens = table["num_characters"].to_numpy() / 1e9 * per_character
    loss = table["Lossu"].to_numpy()

    def value(theta):
        a1, a2, b, e, alpha2, beta = theta
        found = np.exp(a1) / nonvocab**beta + np.exp(a2) / vocab**alpha2 + np.exp(b) / tokens**beta
        return huber(loss - (found - np.exp(e))).sum()

    levels, exponents = (0, 2.5, 5), (0, 0.5, 1)
    starts = list(itertools.product(levels, levels, levels, (0, 2), exponents, exponents))
    bounds = [(None, None)] * 4 + [(0.1, 1.0)] * 2

    def one_start(start):
        with np.errstate(all="ignore"):
            return minimize(value, start, method="L-BFGS-B", bounds=bounds).fun

    def ours_value(fitted, _):
        logs = [np.log(fitted[name]) for name in ("A1", "A2", "B", "E")]
        return value([*logs, fitted["alpha2"], fitted["beta"]])

    columns = (
        "params_nonvocab=Non_vocab_parameters/1e6,params_vocab=vocab_size*embed_dim/1e6,"
        "tokens=num_characters/1e9*(0.00639222*ln(vocab_size/1000)^2"
        "-0.15811069*ln(vocab_size/1000)+1.20470122),loss=Lossu"
    )
    ours = [str(path), "--columns", columns, "--where", "FLOPs >= 2.18e17"]
    ours += ["--law", "approach3-vocab", "--space", "raw", "--huber", "1e-3", "--tied", "--bootstrap", "0"]
    run = lambda which: [one_start(starts[i]) for i in which]  # noqa: E731
    return [Case("vocabulary", ours, ours_value, run, len(starts))]


# --- Collection ---------------------------------------------------------------------------------


def projected(n, d, loss, reweighted=20):
    """The lowest mean Huber(1e-3) over a 0.01 grid of both exponents."""
    grid = np.arange(1, 101) / 100
    of_d = d[None, :] ** -grid[:, None]
    design = np.ones((len(grid), len(loss), 3))
    design[:, :, 2] = of_d
    best = np.inf
    for alpha in grid:
        design[:, :, 1] = (n**-alpha)[None, :]
        weights = np.ones((len(grid), len(loss)))
        for _ in range(1 + reweighted):
            weighted = design * weights[:, :, None]
            gram = weighted.transpose(0, 2, 1) @ design
            # No smaller than rounding, or the grid's corners cannot be solved.
            gram += 1e-13 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            moments = (weighted * loss[None, :, None]).sum(axis=1)
            solution = np.linalg.solve(gram, moments[:, :, None])[:, :, 0]
            residual = loss[None, :] - (design @ solution[:, :, None])[:, :, 0]
            weights = DELTA / np.maximum(np.abs(residual), DELTA)
        positive = (solution >= 0).all(axis=1)
        values = np.where(positive, huber(residual).mean(axis=1), np.inf)
        best = min(best, values.min())
    return best


def collection_cases():
    path = RUNS / "isoflop_collection/isoflops.csv"
    if absent(path):
        return []
    table = pd.read_csv(path)
    return [collection_case(path, name, rows) for name, rows in table.groupby("experiment")]


def collection_case(path, experiment, rows):
    n, d = rows["params"].to_numpy() / 1e6, rows["tokens"].to_numpy() / 1e9
    loss = rows["loss"].to_numpy()

    def objective(f, _):
        return huber(loss - (f["E"] + f["A"] * n ** -f["alpha"] + f["B"] * d ** -f["beta"])).mean()

    columns = "params=params/1e6,tokens=tokens/1e9,loss=loss,budget_flops=budget"
    ours = [str(path), "--columns", columns, "--where", f'experiment == "{experiment}"']
    ours += ["--law", "approach3", "--space", "raw", "--huber", "0.001", "--bootstrap", "0"]
    name = f"collection, {experiment.split('__')[0]}"
    return Case(name, ours, objective, lambda _: [projected(n, d, loss)], None)


# --- Timing -------------------------------------------------------------------------------------


def absent(path):
    if not path.exists():
        print(f"skipped: {path} is absent")
    return not path.exists()


def children_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def time_ours(binary, case, at_least_s=0.3):
    """Processor seconds of one run, averaged over enough of them; the law."""
    command = [binary, "fit", *case.ours, "--json"]
    before, repeats = children_s(), 0
    while children_s() - before < at_least_s:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        repeats += 1
    return (children_s() - before) / repeats, json.loads(done.stdout)


def time_peer(case, share, rng):
    """Processor seconds, scaled to all pieces; the pieces run and their objectives."""
    which = [0]
    scale = 1.0
    if case.pieces:
        count = max(1, round(share * case.pieces))
        which = rng.choice(case.pieces, count, replace=False)
        scale = case.pieces / count
    before = time.process_time()
    values = case.peer(which)
    return (time.process_time() - before) * scale, which, values


def fitted(document):
    return document.get("parametric") or document["laws"]["parametric"]


def measure(binary, case, share, rounds):
    rng = np.random.default_rng(0)
    ours, theirs, ours_value, their_values = [], [], [], []
    for _ in range(rounds):
        spent, document = time_ours(binary, case)
        ours.append(spent)
        spent, which, values = time_peer(case, share, rng)
        theirs.append(spent)
        ours_value.append(case.objective(fitted(document), which))
        their_values.extend(values)
    their_values = np.array(their_values)
    value, their_value = case.reduce(ours_value), case.reduce(their_values)
    return {
        "case": case.name,
        "ours_s": statistics.median(ours),
        "theirs_s": statistics.median(theirs),
        "ratios": sorted(t / o for t, o in zip(theirs, ours)),
        "objective": value,
        "their_objective": their_value,
        "excess": their_value / value - 1,
        "reached": np.mean(their_values <= min(value, their_value) * (1 + REACHED))
        if case.pieces and case.reduce is np.min
        else None,
        "part": case.pieces and share < 1,
    }


def row(r):
    ratios = r["ratios"]
    mark = "~" if r["part"] else ""
    reached = "" if r["reached"] is None else f"{100 * r['reached']:.1f} %"
    return [
        r["case"],
        f"{r['ours_s']:.4f}",
        f"{mark}{r['theirs_s']:.3g}",
        f"{statistics.median(ratios):.0f} ({ratios[0]:.0f} to {ratios[-1]:.0f})",
        f"{r['objective']:.9g}",
        f"{r['their_objective']:.9g}",
        f"{100 * r['excess']:+.4f} %",
        reached,
    ]


HEAD = ["case", "ours, s", "theirs, s", "ratio (least to most)", "objective, ours", "theirs",
        "theirs above", "their starts there"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("binary", help="isoflop's binary, built for release")
    parser.add_argument("--share", type=float, default=0.1, help="of their starts and replicates")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", help="cases whose name holds this")
    options = parser.parse_args()
    if not 0 < options.share <= 1 or options.rounds < 1:
        parser.error("--share is above 0 and at most 1, --rounds at least 1")
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    print(f"core {core}, numpy {np.__version__}, share {options.share}, {options.rounds} rounds")
    if options.share < 1:
        print(f"~: scaled up from {options.share} of the starts or replicates, drawn each round")
    print("| " + " | ".join(HEAD) + " |")
    print("|" + " --- |" * len(HEAD))
    for case in [*chinchilla_cases(), *vocabulary_cases(), *collection_cases()]:
        if options.only in case.name:
            result = measure(options.binary, case, options.share, options.rounds)
            print("| " + " | ".join(row(result)) + " |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
