"""LG-Tok's and ScaMo's claims in small: trains the parts of the study, gathers their numbers, and tests each claim.

    python3 experiments/lg_tok_claims.py run [ISOFLOP [PART...]]     # trains; what is there is not done again
    python3 experiments/lg_tok_claims.py gather                      # writes results/lg-tok-claims/claims.csv
    python3 experiments/lg_tok_claims.py test                        # prints the tables from claims.csv

A part is a sweep of experiments with other keys, in results/lg-tok-claims/PART. Its runs differ in an arm and in the
seed of the tokenizer, 0 to 4 (`codes`: 0 to 2). All parts have one evaluator, which the first one
trains. The parts `words` and `sentence` want data/minilm-words.safetensors and data/minilm-sentence.safetensors, which
embed_captions.py makes of all-MiniLM-L6-v2 with `--level word` and `--level sentence`.

The test was named before the first run: for each claim and measure below, the paired t-test over the seeds,
two-sided, with its 95 % interval, and Holm's correction over the first measures of all claims. Beside it stand
Welch's interval, which does not pair, and the difference that the paired test sees with a power of 80 %. Needs SciPy.
"""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy import stats

FOLDER = Path("results/lg-tok-claims")
SEEDS = range(5)

BOTH = "{at: [tokenizer, detokenizer], drop: 0.1}"
CONVOLUTIONAL = "kind: convolutional, width: 64, depth: 2, batch: 24, steps: 500, seeds: [0, 1, 2, 3, 4]"
RESIDUAL = "{kind: residual, layers: 4, inner: vq, dropout: 0.2}"
MOMASK = [
    "generator=masked",
    "scores={guidance: 3, top_k: 13, rounds: 18, repeats: 5, multimodal_captions: 0, samples: 0}",
    "model={ffn: gelu, rope_base: 1e4, motion_slots: 51, corruption: 0.1, text_drop: 0.1}",
]
# Short runs, which are there to have true motions through the tokenizer scored; what they make is not compared.
TOKENIZERS_ALONE = [
    "grid.budgets=[1e11]",
    "scores={guidance: 4, top_p: 0.95, repeats: 1, multimodal_captions: 0, samples: 0}",
]
# Motions end by themselves here, and their captions are read by an autoregressive transformer.
SCAMO = [
    "seeds=[0]",
    "tokenizer={kind: patch, steps: 400, acceleration_weight: 1.5, root_weight: 0.02, sideways_scale: 2, "
    "seeds: [0, 1, 2, 3, 4]}",
    "grid.budgets=[5e11]",
    "scores={repeats: 5, multimodal_captions: 0, samples: 0}",
]
# The sweep of a part, where it is not lg-tok-claims.
SWEEPS = {"quantizers": "fsq-vq", "words": "text-encoders", "sentence": "text-encoders"}
# What each part sets beside its sweep; `language` and `quantizers` keep the sweep's own axis.
PARTS = {
    "language": [],
    # Windows that hold the longest scale, as many frames a step; three seeds, since they take long.
    "codes": [
        "grid.vary={tokenizer.quantizer.scales: [mini, mid, full]}",
        f"tokenizer.language={BOTH}",
        "tokenizer.window=196",
        "tokenizer.batch=8",
        "tokenizer.seeds=[0, 1, 2]",
    ],
    "networks": [
        "grid.vary={}",
        "tokenizer={" + CONVOLUTIONAL + ", loss: joints, window: 100, "
        "quantizer: {kind: multiscale, inner: vq, scales: mini, cosine: false, mix: 0.5}}",
    ],
    "positions": ["grid.vary={tokenizer.positions: [learned]}", f"tokenizer.language={BOTH}", *TOKENIZERS_ALONE],
    "norms": ["grid.vary={tokenizer.norm: [post, layer]}", f"tokenizer.language={BOTH}", *TOKENIZERS_ALONE],
    "activations": ["grid.vary={tokenizer.ffn: [gelu]}", f"tokenizer.language={BOTH}", *TOKENIZERS_ALONE],
    "latents": ["grid.vary={tokenizer.latents: [25]}", f"tokenizer.language={BOTH}", *TOKENIZERS_ALONE],
    "skips": ["grid.vary={tokenizer.skips: [false]}", f"tokenizer.language={BOTH}", *TOKENIZERS_ALONE],
    "momask": [
        "grid.vary={}",
        "tokenizer={" + CONVOLUTIONAL + f", window: 64, quantizer: {RESIDUAL}" + "}",
        *MOMASK,
    ],
    "momask-lg": [
        "grid.vary={}",
        f"tokenizer.language={BOTH}",
        f"tokenizer.quantizer={RESIDUAL}",
        "tokenizer.window=64",
        *MOMASK,
    ],
    "quantizers": [],
    "words": SCAMO,
    "sentence": [*SCAMO, "text={encoder: file, path: data/minilm-sentence.safetensors, dim: 384, max_tokens: 1}"],
}


def run(isoflop, names):
    """Trains the parts one after another; the evaluator of the first serves all."""
    for name in names:
        (FOLDER / name).mkdir(parents=True, exist_ok=True)
        share("evaluators", FOLDER / name, PARTS)
        if name in ("words", "sentence"):
            share("tokenizers", FOLDER / name, ["words", "sentence"])
        sweep = f"experiments/{SWEEPS.get(name, 'lg-tok-claims')}.yaml"
        sets = [f"name={name}", *PARTS[name]]
        command = [isoflop, "run", sweep, "--out", FOLDER, "--jobs", "1", "--quiet"]
        subprocess.run(command + [word for key in sets for word in ("--set", key)], check=True)
        if name == "language":
            guide(isoflop, FOLDER / name)


def share(kind, folder, parts):
    """Copies what another part has trained, as `evaluators`; ids tell whether it is what this part wants."""
    for trained in (FOLDER / part / kind for part in parts):
        if trained.is_dir() and not (folder / kind).is_dir():
            shutil.copytree(trained, folder / kind)


def guide(isoflop, folder):
    """Scores the runs whose tokenizer reads in both halves with its guidance at 1 and 2; scores have 0."""
    for row in runs_of(folder):
        if row["record"] is None or not row["arm"].startswith("both"):
            continue
        for strength in (1, 2):
            out = folder / f"guided-{row['run_id']}-{strength}.json"
            if not out.exists():
                command = [isoflop, "evaluate", "--run", folder / "runs" / row["run_id"], "--json", "--guidance", "4",
                           "--top-p", "0.95", "--repeats", "5", "--no-multimodality",
                           "--detokenizer-guidance", str(strength)]
                made = subprocess.run(command, check=True, capture_output=True).stdout
                out.write_bytes(made)


# Gathering

MEASURES = {
    "rfid": "FID of true motions through the tokenizer",
    "mpjpe": "MPJPE on the test split, own heading, mm",
    "mpjpe_given": "the same with the heading given, mm",
    "l1": "L1 of the features",
    "codes": "exponential entropy of the tokenizer's codes",
    "gfid": "FID of generated motions",
    "r1": "R@1 of generated motions",
    "perplexity": "exp of the generator's loss in nats a code",
    "loss": "L_u, nats a code",
}


def runs_of(folder):
    """The runs of a part whose tokenizer is trained: id, arm, the numbers of the tokenizer, and those of the run, if it is done."""
    for place in sorted(file.parent for file in folder.glob("runs/*/spec.json")):
        spec, record = read(place / "spec.json"), place / "record.json"
        metrics = folder / "tokenizers" / spec["tokenizer_id"] / "metrics.json"
        if metrics.exists():
            tokenizer = read(metrics)
            yield {"run_id": place.name, "arm": arm_of(folder.name, spec.get("varied"), tokenizer),
                   "tokenizer": tokenizer, "record": read(record)["metrics"] if record.exists() else None}


def arm_of(part, varied, tokenizer):
    """A short name of what varies in a part, as `both` or `mid`."""
    if part == "quantizers":
        return f"{tokenizer['kind']} {tokenizer['n_vocab']}"
    if varied is None:
        return {"momask-lg": "both", "words": "prefix", "sentence": "vector"}.get(part, "convolutional")
    key, value = varied.split("=", 1)
    if key != "tokenizer.language":
        return value
    language = json.loads(value)
    at = "both" if len(language["at"]) == 2 else "".join(language["at"]) or "none"
    return at if language["drop"] else f"{at}, no drop"


def rows_of(part):
    """A row for each run, and for each strength of the detokenizer's guidance that it was scored with."""
    folder, alone = FOLDER / part, TOKENIZERS_ALONE[0] in PARTS[part]
    scores = {one["run_id"]: one for one in map(read, folder.glob("scores/*/scores.json"))}
    for run in runs_of(folder):
        tokenizer, record, scored = run["tokenizer"], run["record"], scores.get(run["run_id"])
        row = {"part": part, "arm": run["arm"], "seed": tokenizer["seed"]}
        measured = {"mpjpe": tokenizer["mpjpe_mm"], "mpjpe_given": tokenizer["mpjpe_heading_mm"],
                    "l1": tokenizer["reconstruction_l1"], "codes": tokenizer["exponential_entropy"]}
        if record and not alone:
            measured |= {"perplexity": np.exp(record["loss_nats"]), "loss": record["loss_normalised"]}
        if scored:
            measured |= {**({} if alone else scored_by(scored)), "rfid": scored["reconstructed"]["fid"]["mean"]}
        yield row | measured
        for strength in (1, 2):
            guided = folder / f"guided-{run['run_id']}-{strength}.json"
            if guided.exists():
                yield row | {"arm": f"{run['arm']}, g = {strength}", **scored_by(read(guided))}


def scored_by(scores):
    return {"gfid": scores["made"]["fid"]["mean"], "r1": scores["made"]["precision"][0]["mean"]}


def read(file):
    return json.loads(file.read_text())


def gather():
    """Writes the rows of the parts that are here; those of other parts stay as they are in the file."""
    here = [part for part in PARTS if (FOLDER / part).is_dir()]
    rows = [row for row in kept_rows() if row["part"] not in here]
    # A run that was begun and never ended may stand beside the one that was: the row with the most measures is kept.
    fullest = {(row["part"], row["arm"], row["seed"]): row for part in here for row in sorted(rows_of(part), key=len)}
    rows += fullest.values()
    rows.sort(key=lambda row: (list(PARTS).index(row["part"]), row["arm"], int(row["seed"])))
    with open(FOLDER / "claims.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, ["part", "arm", "seed", *MEASURES], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"{len(rows)} rows in {FOLDER / 'claims.csv'}")


def kept_rows():
    file = FOLDER / "claims.csv"
    return list(csv.DictReader(file.open())) if file.exists() else []


# Tests

# A claim: its source, the arm, the arm that it is compared with (as PART ARM), and the measures that it is about.
CLAIMS = [
    ("language in both halves (Table 4e)", "language both", "language none", ["rfid", "mpjpe", "perplexity", "gfid", "r1"]),
    ("language in the tokenizer alone (4e)", "language tokenizer", "language none", ["rfid", "mpjpe"]),
    ("language in the detokenizer alone (4e)", "language detokenizer", "language none", ["rfid", "mpjpe"]),
    ("language drop of 0.1 (Table 5)", "language both", "language both, no drop", ["rfid", "gfid", "r1"]),
    ("detokenizer guidance 2 (Tables 5, 8)", "language both, g = 2", "language both", ["gfid", "r1"]),
    ("detokenizer guidance 1", "language both, g = 1", "language both", ["gfid", "r1"]),
    ("guidance 2 without drop", "language both, no drop, g = 2", "language both, no drop", ["gfid", "r1"]),
    ("160 codes in place of 104 (Table 1)", "codes mid", "codes mini", ["rfid", "mpjpe", "gfid"]),
    ("236 codes in place of 160 (Table 1)", "codes full", "codes mid", ["rfid", "mpjpe", "gfid"]),
    ("a transformer, no language (Table 2)", "language none", "networks convolutional", ["rfid", "mpjpe", "gfid", "r1"]),
    ("rotary positions (4d)", "language both", "positions learned", ["rfid", "mpjpe"]),
    ("RMSNorm before each part", "language both", "norms post", ["rfid", "mpjpe"]),
    ("RMSNorm in place of LayerNorm (4a)", "norms post", "norms layer", ["rfid", "mpjpe"]),
    ("SwiGLU in place of GELU (4b)", "language both", "activations gelu", ["rfid", "mpjpe"]),
    ("skips (4c)", "language both", "skips false", ["rfid", "mpjpe"]),
    ("25 latents whatever the length", "latents 25", "language both", ["rfid", "mpjpe"]),
    ("MoMask on LG-Tok's tokenizer (Table 3)", "momask-lg both", "momask convolutional", ["rfid", "mpjpe", "gfid", "r1"]),
    *((f"FSQ in place of VQ, V = {V} (ScaMo's Table 5)", f"quantizers fsq {V}", f"quantizers vq {V}",
       ["mpjpe", "l1", "codes"]) for V in (240, 1000, 4375, 15360)),
    ("words before the codes in place of a vector (ScaMo's Table 2)", "words prefix", "sentence vector",
     ["gfid", "r1", "loss"]),
]


def test():
    arms = {}
    for row in kept_rows():
        arms.setdefault(f"{row['part']} {row['arm']}", {})[int(row["seed"])] = row
    print_arms(arms)
    print_claims(arms)


def print_arms(arms):
    print("| arm | seeds | " + " | ".join(MEASURES) + " |\n" + "| --- " * (len(MEASURES) + 2) + "|")
    for arm, rows in arms.items():
        cells = [cell([float(row[key]) for row in rows.values() if row[key]]) for key in MEASURES]
        print(f"| {arm} | {len(rows)} | " + " | ".join(cells) + " |")


def cell(values):
    """Mean and deviation."""
    return f"{np.mean(values):.4g} ± {np.std(values, ddof=1):.2g}" if len(values) > 1 else " ".join(map(str, values))


def print_claims(arms):
    tests = [(claim, measure, *pairs_of(arms, one, other, measure))
             for claim, one, other, measures in CLAIMS if one in arms and other in arms for measure in measures]
    tests = [test for test in tests if len(test[2]) > 2]
    if len(tests) == 0:
        sys.exit("no claim has three seeds yet")
    first = {claim: measures[0] for claim, _, _, measures in CLAIMS}
    primary = [i for i, (claim, measure, *_) in enumerate(tests) if first[claim] == measure]
    adjusted = dict(zip(primary, holm([paired(*tests[i][2:])[2] for i in primary])))
    print("\n| claim | measure | difference | 95 %, seed by seed | p | Holm's | 95 %, not paired | seen with 80 % |")
    print("| --- " * 8 + "|")
    for i, (claim, measure, one, other) in enumerate(tests):
        mean, half, p = paired(one, other)
        low, high = welch(one, other)
        seen, holms = power(one, other), f"{adjusted[i]:.2f}" if i in adjusted else ""
        print(f"| {claim} | {measure} | {mean:.3g} | {mean - half:.3g} to {mean + half:.3g} | {p:.3f} | {holms} "
              f"| {low:.3g} to {high:.3g} | {seen:.2g} |")


def pairs_of(arms, one, other, measure):
    """The values of two arms at the seeds at which both were measured."""
    measured = [{seed for seed, row in arms[arm].items() if row[measure]} for arm in (one, other)]
    seeds = sorted(measured[0] & measured[1])
    return tuple(np.array([float(arms[arm][seed][measure]) for seed in seeds]) for arm in (one, other))


def paired(one, other):
    """Mean difference, half of its 95 % interval, and the two-sided p of the paired t-test."""
    difference = one - other
    error = difference.std(ddof=1) / np.sqrt(len(difference))
    return difference.mean(), stats.t.ppf(0.975, len(difference) - 1) * error, stats.ttest_rel(one, other).pvalue


def welch(one, other):
    interval = stats.ttest_ind(one, other, equal_var=False).confidence_interval(0.95)
    return interval.low, interval.high


def power(one, other, wanted=0.8):
    """The true difference that the paired test at 5 % finds with this probability, at the deviation seen."""
    n = len(one)
    limit, unit = stats.t.ppf(0.975, n - 1), (one - other).std(ddof=1) / np.sqrt(n)
    # Deviations that samples have, in units of the true one: SciPy's noncentral t is wrong for three seeds.
    deviations = np.sqrt(stats.chi2.ppf((np.arange(2000) + 0.5) / 2000, n - 1) / (n - 1))
    low, high = 0.0, 50.0
    for _ in range(60):
        middle = (low + high) / 2
        found = stats.norm.sf(limit * deviations - middle) + stats.norm.cdf(-limit * deviations - middle)
        low, high = (low, middle) if found.mean() > wanted else (middle, high)
    return high * unit


def holm(levels):
    """Holm's adjusted levels, in the order given."""
    order = np.argsort(levels)
    adjusted, least = np.empty(len(levels)), 0.0
    for place, index in enumerate(order):
        least = max(least, min(1.0, (len(levels) - place) * levels[index]))
        adjusted[index] = least
    return adjusted


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["run", *rest]:
            if unknown := set(rest[1:]) - set(PARTS):
                sys.exit(f"no part is named {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
            run(rest[0] if rest else "target/release/isoflop", rest[1:] or list(PARTS))
        case ["gather"]:
            gather()
        case ["test"]:
            test()
        case _:
            sys.exit(__doc__)
