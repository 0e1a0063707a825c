"""Experiment trackers, as `isoflop run --track wandb|mlflow` asks for one: `ISOFLOP_TRACK` names it, and
`ISOFLOP_TRACK_PROJECT` the project. All else is left to the client's own variables (`WANDB_MODE=offline`,
`MLFLOW_TRACKING_URI`)."""

import os
import sys


def tracker(spec):
    """What follows the run of a spec: `log(step, values)` and `finish(done)`."""
    name = os.environ.get("ISOFLOP_TRACK", "")
    if name in ("", "tensorboard"):  # isoflop writes TensorBoard's files itself
        return Tracker()
    if name not in TRACKERS:
        raise SystemExit(f"ISOFLOP_TRACK={name}: the trackers are {', '.join(TRACKERS)}")
    kind, package = TRACKERS[name]
    try:
        return kind(spec, os.environ.get("ISOFLOP_TRACK_PROJECT") or "isoflop")
    except ImportError as missing:
        raise SystemExit(f"--track {name} needs {missing.name}: `pip install {package}`") from missing
    except Exception as error:
        raise SystemExit(f"--track {name}: {error}") from error


class Tracker:
    """Follows nothing. A tracker that fails after its start is given up, and the run goes on."""

    broken = False

    def log(self, step, values):
        """Numbers by name, at a step."""
        self._try(self._log, step, values)

    def finish(self, done):
        """The process ends: with a result, or without one."""
        self._try(self._finish, done)

    def _try(self, call, *args):
        if self.broken:
            return
        try:
            call(*args)
        except Exception as error:
            self.broken = True
            print(f"warning: the run is tracked no longer: {error}", file=sys.stderr, flush=True)

    def _log(self, step, values):
        pass

    def _finish(self, done):
        pass


class Wandb(Tracker):
    """Weights & Biases: a run that goes on from its checkpoint goes on there too."""

    def __init__(self, spec, project):
        # Not the module: without the client, its folder of an earlier run in the current directory would pass for one.
        from wandb import init

        named = {"project": project, "id": spec.run_id, "name": title(spec)}
        self.run = init(**named, config=numbers(spec), resume="allow")

    def _log(self, step, values):
        # Steps that were logged before a restart are dropped by the client.
        self.run.log(values, step=step)

    def _finish(self, done):
        self.run.finish(exit_code=0 if done else 1)


class Mlflow(Tracker):
    """MLflow: a run is found again by its tag."""

    TAG = "isoflop.run_id"

    def __init__(self, spec, project):
        import mlflow

        self.mlflow = mlflow
        experiment = mlflow.set_experiment(project).experiment_id
        found = mlflow.MlflowClient().search_runs([experiment], f"tags.`{self.TAG}` = '{spec.run_id}'", max_results=1)
        if found:
            mlflow.start_run(run_id=found[0].info.run_id)
        else:
            mlflow.start_run(run_name=title(spec), tags={self.TAG: spec.run_id})
        mlflow.log_params(numbers(spec))

    def _log(self, step, values):
        self.mlflow.log_metrics(values, step=step)

    def _finish(self, done):
        self.mlflow.end_run("FINISHED" if done else "FAILED")


# The class, and the package that holds its client.
TRACKERS = {"wandb": (Wandb, "wandb"), "mlflow": (Mlflow, "mlflow-skinny")}

# What is shown of a spec, beside the layers and widths.
KEYS = (
    "run_id seed n_vocab params_nonvocab params_vocab budget_flops tokens unique_tokens steps batch_tokens "
    "weight_decay precision"
).split()


def title(spec):
    """`autoregressive L2 d16 V64 C=1e9 seed 0`."""
    shape, flops = spec.shape, f"{spec.budget_flops:g}".replace("e+0", "e").replace("e+", "e")
    layers = f"L{shape['n_layer']} d{shape['d_model']} V{spec.n_vocab}"
    return f"{spec.generator['kind']} {layers} C={flops} seed {spec.seed}"


def numbers(spec):
    """The main numbers of a spec by name."""
    shape = {key: spec.shape[key] for key in ("n_layer", "n_head", "d_model", "d_ff", "n_ctx")}
    rest = {key: getattr(spec, key) for key in KEYS}
    return {"generator": spec.generator["kind"], **shape, **rest, "lr": spec.lr["peak"]}
