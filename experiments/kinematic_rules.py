"""Kinematic rules: does a motion do what its caption names?

Sixteen captions in the words of the procedural source, and a rule for each. A rule reads the joints of a motion
(`<f4` [T, 22, 3], metres, 20 frames a second, y up) and answers yes or no. It is strict: the motion must hold
the action and nothing beside it, so a body that waves stays in place, and one that walks does not sit down.
The thresholds were chosen on `isoflop data synth --seed 7 --clips 12000` and are tested on another seed:

    isoflop data synth --seed 1 --clips 16384 --out true
    python3 experiments/kinematic_rules.py captions > captions.txt
    isoflop generate --run results/lg-tok-nano --guidance 3 --samples 8 --texts captions.txt --out made
    python3 experiments/kinematic_rules.py score true made

`score` prints how many true motions of one action pass the rule of their caption, and how many motions of other
captions pass it. For each further folder it prints how many motions pass the rule of their caption (and by which
other rules the rest pass), the rate by the rules of the other fifteen captions, which is chance, both rates by
the limbs alone, with a root that may drift and feet that may float, and how many last longer than any true motion
of the caption. Intervals are Wilson's, 95 %. It needs numpy and half a minute.

What the tokenizer alone keeps of the first eight true motions of each action:

    python3 experiments/kinematic_rules.py pick true picked
    isoflop tokenize --run results/lg-tok-nano --out codes picked/*.npy
    isoflop detokenize --run results/lg-tok-nano --out kept codes/*.json
    python3 experiments/kinematic_rules.py score true kept
"""

import json
import re
import shutil
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Callable, NamedTuple

import numpy as np

FPS = 20
PELVIS, NECK = 0, 12
# The left joint and the right one.
HIPS, ANKLES, TOES, SHOULDERS, WRISTS = [1, 2], [7, 8], [10, 11], [16, 17], [20, 21]
LEFT, RIGHT = 0, 1
SIGN = {LEFT: 1, RIGHT: -1}

# Measures of a motion: metres, degrees, seconds


def measure(joints):
    """All that the rules ask of a motion."""
    joints = joints.astype(float)
    across = joints[:, HIPS[LEFT]] - joints[:, HIPS[RIGHT]]
    heading = smooth(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    ahead = np.stack([np.sin(heading), np.zeros_like(heading), np.cos(heading)], axis=1)
    aside = np.stack([np.cos(heading), np.zeros_like(heading), -np.sin(heading)], axis=1)
    m = SimpleNamespace(turn=np.degrees(heading[-3:].mean() - heading[:3].mean()))
    m.swing = np.degrees(np.ptp(heading))
    measure_path(m, smooth(joints[:, PELVIS]) * [1, 0, 1], ahead, aside)
    measure_feet(m, joints, ahead)
    measure_trunk(m, joints, ahead)
    measure_hands(m, joints, aside)
    m.straight = abs(m.turn) < 45 and m.swing < 70 and abs(m.left) < 0.15 + 0.2 * abs(m.forward)
    m.in_place = m.far < 0.5 and m.swing < 45 and m.flight < 0.15
    m.planted = m.in_place and max(m.lift) < 0.12
    m.upright = m.drop < 0.15
    # Runners lift their heels behind, also those who never fly between two frames.
    m.springs = max(m.lift) > 0.18 and m.speed > 1.2
    m.on_foot = m.flying < 0.03 and m.upright
    m.floats = m.flight >= 0.2
    return m


def set_aside_the_root(m):
    """Forgives a body that drifts, bends its way or floats over the floor: what is left are the limbs."""
    forgiven = dict.fromkeys(["in_place", "planted", "straight", "on_foot"], True)
    return SimpleNamespace(**vars(m) | forgiven | {"floats": False})


def measure_path(m, root, ahead, aside):
    """The way of the root by the body's own directions, and its usual highest speed."""
    step = np.diff(root, axis=0, append=root[-1:])
    forward = along(step, ahead)
    m.forward, m.left = forward.sum(), along(step, aside).sum()
    m.speed = np.percentile(smooth(forward, 11), 90) * FPS
    m.path = np.linalg.norm(step, axis=1).sum()
    m.far = np.linalg.norm(root - root[0], axis=1).max()


def measure_feet(m, joints, ahead):
    """How far each foot leaves its place, how long both are off the floor, how often they overtake."""
    ankles, heights = joints[:, ANKLES], [joints[:, ANKLES, 1], joints[:, TOES, 1]]
    m.lift = (heights[0] - np.percentile(heights[0], 20, axis=0)).max(0)
    off = (ankles - np.median(ankles, axis=0)) * [1, 0, 1]
    m.reach = np.linalg.norm(off, axis=2).max(0)
    above = [height - np.percentile(height.min(1), 10) for height in heights]
    flies = np.minimum(*above).min(1) > 0.025
    m.flight, m.flying = longest(flies), flies.mean()
    m.strides = reversals(smooth(along(ankles[:, LEFT] - ankles[:, RIGHT], ahead), 3), 0.12)


def measure_trunk(m, joints, ahead):
    """The pelvis below its standing height, how far behind the feet it is then, and the bend of the spine."""
    pelvis = smooth(joints[:, PELVIS, 1], 3)
    stand = max(pelvis[:3].mean(), np.percentile(pelvis, 90))
    m.rise, m.drop = pelvis.max() - np.median(pelvis), stand - pelvis.min()
    m.drop_at_end = stand - pelvis[-3:].mean()
    low = pelvis <= stand - 0.7 * m.drop
    m.seated = longest(low)
    m.behind = along(joints[:, ANKLES].mean(1) - joints[:, PELVIS], ahead)[low].mean()
    spine = joints[:, NECK] - joints[:, PELVIS]
    bend = smooth(np.degrees(np.arctan2(along(spine, ahead), spine[:, 1])))
    m.bend = bend.max() - np.percentile(bend, 10)


def measure_hands(m, joints, aside):
    """The share of frames in which each hand is up, its waves to the sides then, and claps of both."""
    raised = joints[:, WRISTS, 1] - joints[:, [PELVIS], 1] > 0.2
    m.raised = raised.mean(0)
    out = smooth(along(joints[:, WRISTS] - joints[:, SHOULDERS], aside[:, None]), 3)
    m.waves = [reversals(out[raised[:, side], side], 0.05) for side in (LEFT, RIGHT)]
    gap = np.linalg.norm(joints[:, WRISTS[LEFT]] - joints[:, WRISTS[RIGHT]], axis=1)
    m.gap, m.claps = gap.min(), reversals(gap[raised.all(1)], 0.06)


def along(vectors, direction):
    return (vectors * direction).sum(-1)


def smooth(x, frames=5):
    """The mean of so many frames about each one; the ends are repeated."""
    half = frames // 2
    padded = np.concatenate([x[:1].repeat(half, 0), x, x[-1:].repeat(half, 0)])
    return sum(padded[i : i + len(x)] for i in range(frames)) / frames


def longest(mask):
    """Seconds of the longest run of true frames."""
    best = now = 0
    for on in mask:
        now = now + 1 if on else 0
        best = max(best, now)
    return best / FPS


def reversals(x, least):
    """How often `x` turns back by more than `least`."""
    count, sign, extreme = 0, 0, x[0] if len(x) else 0
    for value in x:
        if sign and sign * (value - extreme) >= 0:
            extreme = value
        elif abs(value - extreme) > least:
            count += sign != 0
            sign, extreme = np.sign(value - extreme), value
    return count


# Rules


def walks(m):
    return m.forward > 0.6 and m.straight and m.strides >= 1 and m.on_foot and not m.springs


def runs(m):
    return m.forward > 1.2 and m.straight and m.springs and not m.floats


def backs_up(m):
    return m.forward < -0.4 and m.straight and m.on_foot


def sidesteps(m, side):
    return m.left * SIGN[side] > 0.28 and abs(m.forward) < 0.3 and m.swing < 45 and m.on_foot


def turns(m, side):
    return 65 < m.turn * SIGN[side] < 115 and m.swing < 125 and m.far < 0.4 and m.on_foot


def circles(m, side):
    return m.turn * SIGN[side] > 230 and m.path > 1.2 and m.strides >= 3 and m.on_foot


def jumps(m):
    return m.flight >= 0.15 and m.rise > 0.08 and m.far < 0.6 and m.swing < 60


def kicks(m, side):
    strikes = m.lift[side] > 0.25 and m.reach[side] > 0.35
    return strikes and m.lift[1 - side] < 0.12 and m.in_place and m.upright


def waves(m, side):
    moves = m.raised[side] > 0.3 and m.waves[side] >= 3
    return moves and m.raised[1 - side] < 0.15 and m.planted and m.upright


def claps(m):
    return m.gap < 0.12 and m.claps >= 3 and m.planted and m.upright


def bows(m):
    return m.bend > 15 and m.drop < 0.12 and m.planted


def squats(m):
    return m.drop > 0.18 and m.drop_at_end < 0.1 and m.behind < 0.22 and m.planted


def sits(m):
    return m.drop > 0.3 and m.behind > 0.25 and m.seated > 0.4 and m.planted


class Action(NamedTuple):
    """A rule; the caption to generate, after "a person"; the true captions that name the action, and those that
    leave it open, which count neither for the rule nor against it."""

    rule: Callable
    caption: str
    named: str
    open: str = "^$"


WALK, TURN = "(walks(?! backward)|strolls|paces)", "(turns|rotates)"
QUARTER = "(ninety degrees|by a quarter turn|by ninety degrees)"
ACTIONS = {
    "walk": Action(walks, "walks forward", f"{WALK}(?!.*(circle|curve|arc |bend|waving))", WALK),
    "run": Action(runs, "runs forward", "runs|jogs|sprints"),
    "back up": Action(backs_up, "walks backward", "walks backward|backs up"),
    "sidestep left": Action(partial(sidesteps, side=LEFT), "sidesteps to the left", "side.* to the left"),
    "circle left": Action(
        partial(circles, side=LEFT), "walks in a circle to the left", f"{WALK}.*in a (full )?circle.*( left| counter)"
    ),
    "jump": Action(jumps, "jumps up", "(jumps|leaps|hops).* (up|in place|into the air)", "jumps|leaps|hops"),
    "clap": Action(claps, "claps", "claps"),
    "bow": Action(bows, "bows", "bows"),
    "squat": Action(squats, "squats", "squats|crouches"),
    "sit down": Action(sits, "sits down", "sits|takes a seat"),
}
for side, (word, other) in enumerate([("left", "right"), ("right", "left")]):
    ACTIONS |= {
        f"turn {word}": Action(
            partial(turns, side=side),
            f"turns to the {word} ninety degrees",
            f"{TURN}.*{word} {QUARTER}",
            f"{TURN}.*{word}(?!.*(degrees|turn|around|circle|little|slightly))",
        ),
        f"kick {word}": Action(
            partial(kicks, side=side), f"kicks with the {word} leg", f"kicks.*the {word}", f"kicks(?!.*the {other})"
        ),
        f"wave {word}": Action(
            partial(waves, side=side), f"waves the {word} hand", f"waves.*the {word}", f"waves(?!.*the {other})"
        ),
    }

# True and generated motions


class Clip(NamedTuple):
    name: str
    captions: list
    seconds: float
    passes: dict
    limbs: dict


def clip(path, captions=()):
    joints = np.load(path)
    measures = measure(joints)
    passes, limbs = ({a: bool(ACTIONS[a].rule(m)) for a in ACTIONS} for m in (measures, set_aside_the_root(measures)))
    return Clip(path.stem, captions, len(joints) / FPS, passes, limbs)


def true_clips(folder):
    """The clips of a data set in the HumanML3D layout whose captions tell one action."""
    within = re.compile("up and down|and (gets|rises)|(sides|forward) and up")
    joins = re.compile(r", then| and |,? before |\. after that|after which")
    for path in sorted(Path(folder, "texts").glob("*.txt")):
        captions = [line.split("#")[0] for line in path.read_text("utf8").splitlines()]
        if not any(joins.search(within.sub("", caption)) for caption in captions):
            yield clip(Path(folder, "new_joints", f"{path.stem}.npy"), captions)


def naming(action, clips):
    """Whether a caption of each clip names the action."""
    return [any(re.search(ACTIONS[action].named, text) for text in c.captions) for c in clips]


def leaving_open(action, clips):
    """Whether no caption of each clip tells if it holds the action."""
    return [all(re.search(ACTIONS[action].open, text) for text in c.captions) for c in clips]


def by_action(clips):
    return {a: [c for c, own in zip(clips, naming(a, clips)) if own] for a in ACTIONS}


def made_clips(folder):
    """The clips that `isoflop generate` made of the sixteen captions, or `detokenize` of picked motions."""
    listed = Path(folder, "motions.json")
    if not listed.exists():
        return {a: [clip(path) for path in sorted(Path(folder).glob(file_of(a, "*") + ".joints.npy"))] for a in ACTIONS}
    made = [motion["caption"] for motion in json.loads(listed.read_text("utf8"))]
    paths = {a: [Path(folder, f"{i}.joints.npy") for i, text in enumerate(made) if text == caption(a)] for a in ACTIONS}
    return {a: [clip(path) for path in paths[a]] for a in ACTIONS}


def pick(folder, out):
    """Copies the first eight true motions of each action as features with captions, for `isoflop tokenize`."""
    Path(out).mkdir(parents=True)
    for a, clips in by_action(list(true_clips(folder))).items():
        for i, c in enumerate(clips[:8]):
            shutil.copy(Path(folder, "new_joint_vecs", f"{c.name}.npy"), Path(out, file_of(a, i) + ".npy"))
            shutil.copy(Path(folder, "texts", f"{c.name}.txt"), Path(out, file_of(a, i) + ".txt"))


def file_of(action, i):
    return f"{action.replace(' ', '-')}-{i}"


def caption(action):
    return f"a person {ACTIONS[action].caption}"


# Rates


def rate(answers):
    """How many answers are yes, with Wilson's interval."""
    n, k, z = len(answers), sum(answers), 1.96
    middle, half = k + z * z / 2, z * np.sqrt(k * (n - k) / n + z * z / 4)
    low, high = (100 * (middle + sign * half) / (n + z * z) for sign in (-1, 1))
    return f"{k} of {n}, {100 * k / n:.1f} % ({low:.1f} to {high:.1f})"


def print_all(found):
    """Prints how many motions pass the rule of their caption, and how many those of the other captions."""
    for name, answers in [("all", lambda c: c.passes), ("limbs alone", lambda c: c.limbs)]:
        pairs = [(a == b, answers(c)[b]) for a, clips in found.items() for c in clips for b in ACTIONS]
        other = np.mean([passes for own, passes in pairs if not own])
        print(f"{name:14} {rate([passes for own, passes in pairs if own])}; other captions' rules {100 * other:.1f} %")


def score_true(folder):
    """Prints the rates of true motions; returns them by action."""
    clips = list(true_clips(folder))
    true = by_action(clips)
    print(f"{len(clips)} true motions of one action\n{'rule':14} {'of its own caption':34} of other captions")
    for a, own in true.items():
        known = zip(clips, naming(a, clips), leaving_open(a, clips))
        others = [c.passes[a] for c, names, leaves_open in known if not names and not leaves_open]
        shares = {b: np.mean([c.passes[a] for c in true[b]]) for b in ACTIONS if b != a}
        worst = max(shares, key=shares.get)
        told = f"; {100 * shares[worst]:.0f} % of {worst}" if shares[worst] else ""
        print(f"{a:14} {rate([c.passes[a] for c in own]):34} {rate(others)}{told}")
    fewest = min(map(len, true.values()))
    print(f"the first {fewest} of each:")
    print_all({a: own[:fewest] for a, own in true.items()})
    return true


def score_made(folder, true):
    """Prints the rates of generated motions."""
    print(f"\n{folder}")
    made, too_long = made_clips(folder), []
    for a, clips in made.items():
        too_long += [c.seconds > max(t.seconds for t in true[a]) for c in clips]
        instead = Counter(b for c in clips if not c.passes[a] for b in ACTIONS if c.passes[b])
        told = "".join(f", {n} pass {b}" for b, n in instead.most_common())
        passed, limbs = sum(c.passes[a] for c in clips), sum(c.limbs[a] for c in clips)
        print(f"{a:14} {passed} of {len(clips)}, by the limbs alone {limbs}{told}")
    print_all(made)
    print(f"{'too long':14} {rate(too_long)}: longer than any true motion of their caption")


def main(words):
    match words:
        case ["captions"]:
            print("\n".join(map(caption, ACTIONS)))
        case ["pick", true, out]:
            pick(true, out)
        case ["score", true, *made]:
            found = score_true(true)
            for folder in made:
                score_made(folder, found)
        case _:
            sys.exit("usage: kinematic_rules.py captions | pick TRUE OUT | score TRUE [MADE ...]")


if __name__ == "__main__":
    main(sys.argv[1:])
