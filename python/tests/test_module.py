"""The module's calls, with the program that `ISOFLOP_PROGRAM` names or that the wheel holds.

    python3 -m unittest discover python/tests
"""

import importlib.util
import math
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import isoflop

ROOT = Path(__file__).resolve().parents[2]
STUDY = ROOT / "results" / "cmu-motion"


def _table():
    """A loss of N and D that the fit must find: E = 1.7, alpha = 0.34, beta = 0.28."""
    rows = [(n, d) for n in (1e7, 3e7, 1e8, 3e8, 1e9) for d in (1e9, 3e9, 1e10, 3e10)]
    loss = [1.7 + 400 * n**-0.34 + 410 * d**-0.28 for n, d in rows]
    return {"N": [n for n, _ in rows], "D": [d for _, d in rows], "L": loss}


COLUMNS = {"params": "N", "tokens": "D", "loss": "L"}


class Module(unittest.TestCase):
    def test_predict_by_a_published_law(self):
        [found] = isoflop.predict(1e18, law="scamo")
        self.assertAlmostEqual(found.loss, -5.277, places=3)
        self.assertEqual(found.shape.n_vocab, math.prod(found.shape.levels))
        self.assertIsNone(found.ci95["loss_normalised"])
        self.assertEqual(len(isoflop.predict(1e17, 1e18, law="scamo")), 2)

    def test_fit_finds_the_law_of_a_table_and_predicts_by_it(self):
        laws = isoflop.fit(_table(), columns=COLUMNS, law="approach3")
        self.assertAlmostEqual(laws.parametric["alpha"], 0.34, places=4)
        [found] = isoflop.predict(1e21, law=laws)
        self.assertAlmostEqual(6 * found.params * found.tokens / 1e21, 1, places=6)

    def test_the_loss_of_a_model_on_more_tokens_than_the_optimum(self):
        laws = isoflop.fit(_table(), columns=COLUMNS, law="approach3")
        found = isoflop.predict_loss(params=1e9, tokens=1e12, law=laws)
        self.assertAlmostEqual(found.loss, 1.7 + 400 * 1e9**-0.34 + 410 * 1e12**-0.28, places=4)
        self.assertGreater(found.loss_above_optimum, 0)
        self.assertLess(found.optimum["tokens"], 1e12)
        self.assertAlmostEqual(found.flops / 6e21, 1, places=9)
        with self.assertRaisesRegex(isoflop.IsoflopError, "--law approach3"):
            isoflop.predict_loss(params=1e9, tokens=1e12, law="scamo")

    def test_frames_are_fitted_as_mappings_are(self):
        expected = isoflop.fit(_table(), columns=COLUMNS, law="approach3").parametric["beta"]
        frames = [name for name in ("polars", "pandas") if importlib.util.find_spec(name)]
        if not frames:
            self.skipTest("neither polars nor pandas is installed")
        for name in frames:
            frame = importlib.import_module(name).DataFrame(_table())
            found = isoflop.fit(frame, columns=COLUMNS, law="approach3").parametric["beta"]
            self.assertEqual(found, expected, name)

    def test_a_study_is_read(self):
        results = isoflop.read(STUDY)
        self.assertEqual(results.name, "cmu-motion")
        self.assertTrue(any(minimum.flags for minimum in results.laws.minima))
        law = results.laws.power_laws["params_nonvocab"]
        low, high = law.exponent_ci95
        self.assertTrue(low <= law.exponent <= high)
        self.assertGreater(law(1e12), law(1e11))
        self.assertEqual(results.predictions[0].budget_flops, 1e11)
        if importlib.util.find_spec("polars") or importlib.util.find_spec("pandas"):
            self.assertIn("loss_normalised", results.runs.columns)
        else:
            with self.assertRaisesRegex(isoflop.IsoflopError, "polars or pandas"):
                results.runs

    def test_laws_that_were_read_can_be_written_and_predict(self):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            (folder / "runs.csv").write_text("run_id\n")
            words = ["fit", str(STUDY), "--out", str(folder / "laws.json")]
            isoflop._program.ask(words)
            self.assertIn('"digest": "blake3:', (folder / "laws.json").read_text())
            laws = isoflop.read(folder).laws
            self.assertNotIn("digest", laws.document)
            self.assertEqual(isoflop.predict(1e12, law=laws), isoflop.predict(1e12, law=folder))

    def test_whatever_is_wrong_is_an_error_of_isoflop(self):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            (folder / "runs.csv").write_text("run_id\n")
            plain, script = folder / "plain", folder / "script"
            plain.write_text("no program")
            script.write_text("#!/bin/sh\necho words\n")
            script.chmod(0o755)
            damaged = {"laws.json": b"{", "prediction.json": b"[{}]"}

            def read_with(name):
                (folder / name).write_bytes(damaged[name])
                try:
                    isoflop.read(folder)
                finally:
                    (folder / name).unlink()

            def by(program):
                with mock.patch.dict("os.environ", {"ISOFLOP_PROGRAM": str(program)}):
                    isoflop.predict(1e18, law="scamo")

            wrong = {
                "a budget that is a word": lambda: isoflop.predict("much", law="scamo"),
                "no budget": lambda: isoflop.predict(None, law="scamo"),
                "a law that is a number": lambda: isoflop.predict(1e18, law=7),
                "a path with a null byte": lambda: isoflop.predict(1e18, law="a\0b"),
                "parameters that are a list": lambda: isoflop.predict_loss(params=[1], tokens=1, law="scamo"),
                "columns that are a list": lambda: isoflop.fit(_table(), columns=["N"]),
                "a law of fit that is none": lambda: isoflop.fit(_table(), law=None),
                "options that are numbers": lambda: isoflop.fit(_table(), options=[1]),
                "columns of scalars": lambda: isoflop.fit({"N": 1, "D": 2}),
                "runs that are a number": lambda: isoflop.fit(7),
                "a folder that is a number": lambda: isoflop.read(7),
                "scores that are not there": lambda: isoflop.read(folder).scores,
                "laws that are cut": lambda: read_with("laws.json"),
                "a prediction of nothing": lambda: read_with("prediction.json"),
                "a program that is not there": lambda: by(folder / "none"),
                "a program that is none": lambda: by(plain),
                "a program that says something else": lambda: by(script),
            }
            for what, call in wrong.items():
                with self.subTest(what), self.assertRaises(isoflop.IsoflopError):
                    call()

    def test_a_condition_alone_is_one_condition(self):
        some = isoflop.fit(_table(), columns=COLUMNS, law="approach3", where="N > 2e7")
        self.assertEqual(some.parametric["n"], 16)

    def test_errors_are_the_programs_sentences(self):
        with self.assertRaisesRegex(isoflop.IsoflopError, "no/such") as caught:
            isoflop.fit("no/such.csv")
        self.assertEqual(caught.exception.code, 2)
        with self.assertRaisesRegex(isoflop.IsoflopError, "holds no runs.csv"):
            isoflop.read(ROOT / "src")
        with self.assertRaisesRegex(isoflop.IsoflopError, "one length"):
            isoflop.fit({"N": [1.0], "D": []})
        with self.assertRaisesRegex(isoflop.IsoflopError, "a frame, a mapping"):
            isoflop.fit(7)


if __name__ == "__main__":
    unittest.main()
