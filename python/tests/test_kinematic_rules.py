"""The kinematic rules of `experiments`, on true motions of the program that `ISOFLOP_PROGRAM` names.

    python3 -m unittest discover python/tests
"""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import numpy as np
except ImportError as error:
    raise unittest.SkipTest("the kinematic rules need numpy") from error

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "experiments"))
import kinematic_rules as rules  # noqa: E402

# Left and right joints of HumanML3D's skeleton.
PAIRS = [(1, 2), (4, 5), (7, 8), (10, 11), (13, 14), (16, 17), (18, 19), (20, 21)]


def _passed(joints):
    measures = rules.measure(joints)
    return [a for a, action in rules.ACTIONS.items() if action.rule(measures)]


def _mirrored(joints):
    order = list(range(22))
    for left, right in PAIRS:
        order[left], order[right] = right, left
    return joints[:, order] * [-1, 1, 1]


class Rules(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.data = Path(folder.name, "true")
        program = os.environ.get("ISOFLOP_PROGRAM", "isoflop")
        wanted = ["--clips", "1500", "--val-clips", "4", "--test-clips", "4", "--seed", "3"]
        subprocess.run([program, "data", "synth", *wanted, "--out", cls.data], check=True, capture_output=True)
        cls.clips = list(rules.true_clips(cls.data))

    def motions(self, count=80):
        return [np.load(path) for path in sorted(self.data.glob("new_joints/*.npy"))[:count]]

    def test_true_motions_pass_the_rule_of_their_caption_and_hardly_another(self):
        own, other = [], []
        for action in rules.ACTIONS:
            named = rules.naming(action, self.clips)
            self.assertTrue(any(named), action)
            own += [c.passes[action] for c, yes in zip(self.clips, named) if yes]
            is_open = rules.leaving_open(action, self.clips)
            other += [c.passes[action] for c, x, y in zip(self.clips, named, is_open) if not x and not y]
        self.assertGreater(np.mean(own), 0.9)
        self.assertLess(np.mean(other), 0.01)

    def test_a_body_that_stands_still_passes_no_rule(self):
        for joints in self.motions():
            self.assertEqual(_passed(joints[:1].repeat(60, 0)), [])

    def test_a_mirrored_motion_passes_the_rules_of_the_other_side(self):
        seen = set()
        for joints in self.motions(400):
            for action in _passed(joints):
                seen.add(action)
                exchanged = action.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")
                if exchanged in rules.ACTIONS:
                    self.assertIn(exchanged, _passed(_mirrored(joints)))
        self.assertLessEqual({"turn left", "turn right", "kick right", "wave right"}, seen)

    def test_place_and_direction_of_the_first_frame_do_not_matter(self):
        s, c = np.sin(2.1), np.cos(2.1)
        turned = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        for joints in self.motions():
            self.assertEqual(_passed(joints @ turned + [3, 0, -7]), _passed(joints))


if __name__ == "__main__":
    unittest.main()
