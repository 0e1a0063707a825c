STAR = (
    "M0.00,-1.00L0.26,-0.36L0.95,-0.31L0.43,0.14L0.59,0.81L0.00,0"
    ".45L-0.59,0.81L-0.43,0.14L-0.95,-0.31L-0.26,-0.36Z"
)
best = (
    cells.sort("loss_normalised")
    .group_by("budget_flops", "model", maintain_order=True)
    .first()
    .with_columns(
        log10_params=pl.col("params_nonvocab").log10(),
        sizes=pl.col("params_nonvocab").n_unique().over("budget_flops"),
    )
    .sort("budget_flops", "params_nonvocab")
)
by_budget = alt.Color(
    "budget:N",
    sort=budgets,
    title="Budget C (FLOPs)",
    scale=alt.Scale(domain=budgets, scheme="viridis"),
)
params_axis = log_x("params_nonvocab:Q", "Non-vocabulary parameters N_nv")
loss_axis = alt.Y("loss_normalised:Q", scale=LOSS, title="Normalised loss L_u (nats), best over V")

points = alt.Chart(best).mark_point(filled=True, size=60, opacity=1.0).encode(
    x=params_axis,
    y=loss_axis,
    color=by_budget,
    tooltip=["budget", "model", "n_vocab", "params_nonvocab", "tokens", "loss_normalised"],
)
layers = [points]
if best.filter(pl.col("sizes") >= 3).height > 0:
    layers.append(
        alt.Chart(best.filter(pl.col("sizes") >= 3))
        .transform_regression(
            "log10_params", "loss_normalised", method="quad", groupby=["budget"]
        )
        .transform_calculate(params_nonvocab="pow(10, datum.log10_params)")
        .mark_line()
        .encode(x=params_axis, y=loss_axis, color=by_budget)
    )


def minima_table(method):
    """The minima by one method, each flagged, held out or fitted."""
    rows = [minimum for minimum in laws.get("minima") or [] if minimum["method"] == method]
    if held_out:
        rows = [m for m in rows if m["budget_flops"] != held_out["budget_flops"]]
        rows.append(held_out["minimum"])
    numbers = ["budget_flops", "params_nonvocab", "params_vocab", "tokens", "loss_normalised"]
    columns = {name: [float(row[name]) for row in rows] for name in numbers}
    columns["flags"] = [", ".join(row["flags"]) for row in rows]
    table = pl.DataFrame(columns, schema={**{n: pl.Float64 for n in numbers}, "flags": pl.String})
    is_held_out = pl.col("budget_flops") == (held_out["budget_flops"] if held_out else math.nan)
    return table.with_columns(
        role=pl.when(is_held_out)
        .then(pl.lit("held out"))
        .when(pl.col("flags") != "")
        .then(pl.lit("flagged"))
        .otherwise(pl.lit("fitted"))
    )


minima = minima_table(laws.get("minima_method"))
sizes = best["params_nonvocab"]
if minima.height > 0 and best.height > 0:
    # A flagged minimum may lie far outside the models that were tried.
    inside = minima.filter(pl.col("params_nonvocab").is_between(sizes.min(), sizes.max()))
    for flagged in (False, True):
        layers.append(
            alt.Chart(inside.filter((pl.col("flags") != "") == flagged))
            .mark_point(
                shape=STAR, size=90, filled=not flagged, color="#222222", opacity=1.0
            )
            .encode(x=params_axis, y=loss_axis, tooltip=minima.columns)
        )
alt.layer(*layers).properties(width=620, height=400).interactive()
