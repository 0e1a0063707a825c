(
    alt.Chart(cells)
    .mark_line(point=alt.OverlayMarkDef(size=40, filled=True))
    .encode(
        x=alt.X(
            "n_vocab:Q",
            scale=alt.Scale(type="log", nice=False, padding=12),
            axis=alt.Axis(values=cells["n_vocab"].unique().sort().to_list(), format="d"),
            title="Vocabulary size V",
        ),
        y=alt.Y("loss_normalised:Q", scale=LOSS, title="Normalised loss L_u (nats)"),
        color=by_model,
        tooltip=cell_tooltip,
    )
    .properties(width=300, height=220)
    .facet(facet=alt.Facet("budget:N", sort=budgets, title="Budget C (FLOPs)"), columns=2)
)
