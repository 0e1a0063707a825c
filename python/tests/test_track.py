"""What the trainer in PyTorch tells experiment trackers; no torch is needed."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import types
import unittest
from pathlib import Path
from unittest import mock

from isoflop.torch.track import tracker

SPEC = types.SimpleNamespace(
    run_id="0123abcd",
    seed=1,
    generator={"kind": "autoregressive"},
    shape={"n_layer": 2, "n_head": 2, "d_model": 16, "d_ff": 64, "n_ctx": 40},
    n_vocab=64,
    params_nonvocab=6000,
    params_vocab=1024,
    budget_flops=3e9,
    tokens=7000,
    unique_tokens=900,
    steps=20,
    batch_tokens=350,
    weight_decay=0.1,
    precision="f32",
    lr={"peak": 1e-3},
)
PYTHON = Path(__file__).resolve().parents[1]

# A run that is begun, and begun again from its checkpoint, each in a process of its own.
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
from test_track import SPEC, tracker
own, step = tracker(SPEC), int(sys.argv[2])
own.log(step, {"train/loss_nats": 4.0 - step / 10})
own.finish(step == 2)
assert not own.broken
"""


def asked(name):
    return mock.patch.dict(os.environ, {"ISOFLOP_TRACK": name, "ISOFLOP_TRACK_PROJECT": "mini"})


class Calls(unittest.TestCase):
    def test_nothing_is_tracked_unless_asked(self):
        for name in ("", "tensorboard"):
            with asked(name):
                own = tracker(SPEC)
            own.log(1, {"train/loss_nats": 4.0})
            own.finish(True)

    def test_a_name_that_is_no_tracker_is_refused(self):
        with asked("neptune"), self.assertRaisesRegex(SystemExit, "wandb, mlflow"):
            tracker(SPEC)

    def test_a_missing_client_is_one_sentence(self):
        for name, package in (("wandb", "wandb"), ("mlflow", "mlflow-skinny")):
            with asked(name), mock.patch.dict(sys.modules, {name: None}):
                with self.assertRaisesRegex(SystemExit, f"--track {name} needs {name}: `pip install {package}`"):
                    tracker(SPEC)

    def test_wandb_goes_on_with_the_run_of_the_id(self):
        wandb = mock.MagicMock()
        with asked("wandb"), mock.patch.dict(sys.modules, wandb=wandb):
            own = tracker(SPEC)
        given = wandb.init.call_args.kwargs
        self.assertEqual((given["project"], given["id"], given["resume"]), ("mini", "0123abcd", "allow"))
        self.assertEqual(given["name"], "autoregressive L2 d16 V64 C=3e9 seed 1")
        self.assertEqual((given["config"]["d_model"], given["config"]["lr"]), (16, 1e-3))
        own.log(3, {"train/loss_nats": 4.0})
        wandb.init().log.assert_called_once_with({"train/loss_nats": 4.0}, step=3)
        own.finish(False)
        wandb.init().finish.assert_called_once_with(exit_code=1)

    def test_mlflow_finds_the_run_by_its_tag(self):
        mlflow = mock.MagicMock()
        search = mlflow.MlflowClient().search_runs
        for found in ([], [mock.MagicMock()]):
            search.return_value = found
            with asked("mlflow"), mock.patch.dict(sys.modules, mlflow=mlflow):
                own = tracker(SPEC)
        self.assertIn("= '0123abcd'", search.call_args.args[1])
        mlflow.set_experiment.assert_called_with("mini")
        first, again = mlflow.start_run.call_args_list
        self.assertEqual(first.kwargs["tags"], {"isoflop.run_id": "0123abcd"})
        self.assertEqual(again.kwargs, {"run_id": found[0].info.run_id})
        own.log(3, {"train/loss_nats": 4.0})
        mlflow.log_metrics.assert_called_once_with({"train/loss_nats": 4.0}, step=3)
        own.finish(True)
        mlflow.end_run.assert_called_once_with("FINISHED")

    def test_a_tracker_that_fails_later_stops_no_run(self):
        wandb = mock.MagicMock()
        wandb.init().log.side_effect = OSError("the network is gone")
        with asked("wandb"), mock.patch.dict(sys.modules, wandb=wandb), mock.patch("sys.stderr") as stderr:
            own = tracker(SPEC)
            own.log(1, {"train/loss_nats": 4.0})
            own.log(2, {"train/loss_nats": 4.0})
            own.finish(True)
        said = "".join(call.args[0] for call in stderr.write.call_args_list)
        self.assertEqual(said.count("the run is tracked no longer: the network is gone"), 1)


class Clients(unittest.TestCase):
    """The real clients, offline, where they are installed."""

    def runs(self, name, variables):
        if importlib.util.find_spec(name) is None:
            self.skipTest(f"{name} is not installed")
        place = self.place()
        env = os.environ | {key: value.format(place) for key, value in variables.items()}
        env |= {"ISOFLOP_TRACK": name, "ISOFLOP_TRACK_PROJECT": "mini"}
        env["PYTHONPATH"] = os.pathsep.join([str(PYTHON), os.environ.get("PYTHONPATH", "")])
        for step in ("1", "2"):
            command = [sys.executable, "-W", "ignore", "-c", RUN, str(PYTHON / "tests"), step]
            ended = subprocess.run(command, cwd=place, env=env, capture_output=True, text=True)
            self.assertEqual(ended.returncode, 0, ended.stderr)
        return Path(place)

    def place(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        return folder.name

    def test_wandb_keeps_both_starts_of_a_run_under_one_id(self):
        place = self.runs("wandb", {"WANDB_MODE": "offline", "WANDB_DIR": "{}", "WANDB_SILENT": "true"})
        kept = [path.name for path in place.glob("wandb/offline-run-*/run-*.wandb")]
        self.assertEqual(kept, ["run-0123abcd.wandb"] * 2)

    def test_mlflow_keeps_both_starts_as_one_run(self):
        place = self.runs("mlflow", {"MLFLOW_TRACKING_URI": "file:{}/mlruns", "MLFLOW_ALLOW_FILE_STORE": "true"})
        losses = [path for path in place.glob("mlruns/*/*/metrics/train/loss_nats")]
        self.assertEqual(len(losses), 1)
        self.assertEqual([line.split()[2] for line in losses[0].read_text().splitlines()], ["1", "2"])


if __name__ == "__main__":
    unittest.main()
