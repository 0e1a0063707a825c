cells = (
    runs.filter(pl.col("loss_normalised").is_finite())
    .with_columns(
        model=pl.format("{}L {}H {}d", "n_layer", "n_head", "d_model"),
        budget=pl.col("budget_flops").map_elements("{:.3g}".format, return_dtype=pl.String),
        flops=pl.col(f"flops_{rule}"),
    )
    .group_by("model", "params_nonvocab", "n_vocab", "budget", "budget_flops")
    .agg(
        pl.col("flops", "params_vocab", "tokens", "loss_normalised").mean(),
        pl.len().alias("seeds"),
    )
    .sort("budget_flops", "params_nonvocab", "n_vocab")
)
models = cells.sort("params_nonvocab")["model"].unique(maintain_order=True).to_list()
budgets = cells["budget"].unique(maintain_order=True).to_list()
lowest = (
    cells.sort("loss_normalised")
    .group_by("budget_flops", maintain_order=True)
    .first()
    .select("budget_flops", envelope_flops="flops", envelope="loss_normalised")
)

ordered = {"scheme": "viridis"} if len(models) > len(OKABE_ITO) else {"range": OKABE_ITO}
by_model = alt.Color(
    "model:N", sort=models, title="Model", scale=alt.Scale(domain=models, **ordered)
)
cell_tooltip = ["model", "n_vocab", "budget_flops", "flops", "tokens", "loss_normalised", "seeds"]
pick_model = alt.selection_point(fields=["model"], bind="legend")

compute = "Training compute C (FLOPs)"
loss_axis = alt.Y("loss_normalised:Q", scale=LOSS, title="Normalised loss L_u (nats)")
base = alt.Chart(cells.join(lowest, on="budget_flops"))
envelope = base.mark_line(size=7, color="#CDCDCD").encode(
    x=log_x("envelope_flops:Q", compute), y=alt.Y("envelope:Q", scale=LOSS)
)
series = (
    base.mark_line(point=alt.OverlayMarkDef(size=45, filled=True))
    .encode(
        x=log_x("flops:Q", compute),
        y=loss_axis,
        color=by_model,
        opacity=alt.condition(pick_model, alt.value(1.0), alt.value(0.1)),
        tooltip=cell_tooltip,
    )
    .add_params(pick_model)
)
(
    alt.layer(envelope, series)
    .properties(width=300, height=220)
    .facet(facet=alt.Facet("n_vocab:O", title="Vocabulary size V"), columns=2)
)
