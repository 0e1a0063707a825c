import json
import math
from pathlib import Path

import altair as alt
import polars as pl

RESULTS = Path(SWEEP_FOLDER)
if not (RESULTS / "runs.parquet").exists():
    raise FileNotFoundError(
        f"{RESULTS / 'runs.parquet'} does not exist, seen from {Path.cwd()}: start Jupyter in "
        "the notebook's own folder, or set RESULTS to the sweep's folder"
    )

runs = pl.read_parquet(RESULTS / "runs.parquet")
if "share" in runs.columns:
    # Figures and laws of minima are those of the runs that saw the most of the data.
    share = pl.col("share").fill_null(1.0)
    runs = runs.filter(share == share.max())
laws_file = RESULTS / "laws.json"
laws = json.loads(laws_file.read_text()) if laws_file.exists() else {}

power_laws = laws.get("power_laws") or {}
loss_laws = laws.get("loss") or {}
held_out = laws.get("held_out")
rule = laws.get("flops_rule") or "openai"

for warning in laws.get("warnings") or []:
    print("warning:", warning)

alt.data_transformers.disable_max_rows()
pl.Config.set_tbl_cols(-1)
pl.Config.set_tbl_rows(40)

# Okabe and Ito's colours, without the yellow.
OKABE_ITO = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222"]
LOSS = alt.Scale(zero=False, nice=False, padding=12)


def log_scale():
    """Zooms freely, leaves some air, and labels as many powers of ten as fit."""
    axis = alt.Axis(format="~e", labelOverlap="greedy", labelSeparation=10)
    return {"scale": alt.Scale(type="log", nice=False, padding=12), "axis": axis}


def log_x(field, title):
    return alt.X(field, title=title, **log_scale())


def log_y(field, title):
    return alt.Y(field, title=title, **log_scale())
