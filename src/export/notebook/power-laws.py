ROLES = ["fitted", "flagged", "held out"]
reference = laws.get("reference_flops")


def power(law, flops):
    return 10 ** (law["log10_coefficient"] + law["exponent"] * math.log10(flops))


def interval(values):
    """The 2.5th and 97.5th percentile; nothing without replicates."""
    values = pl.Series(values, dtype=pl.Float64)
    if values.len() == 0:
        return None
    return [values.quantile(share, interpolation="linear") for share in (0.025, 0.975)]


def replicates(quantity, flops):
    """A law at one budget, in each bootstrap replicate; quantity is vocab, nonvocab or tokens."""
    ln_ratio = math.log(flops / reference) if bootstrap else 0.0
    return [
        math.exp(sample[f"ln_{quantity}_at_reference"] + sample[f"exponent_{quantity}"] * ln_ratio)
        for sample in bootstrap
    ]


def budgets_along(count=60):
    low, high = minima["budget_flops"].min(), minima["budget_flops"].max()
    if low is None:
        return []
    step = (math.log10(high) - math.log10(low)) / (count - 1)
    return [low * 10 ** (step * i) for i in range(count)]


def minima_marks(field, y):
    """Filled where fitted, hollow where flagged, a diamond where held out."""
    by_role = {"domain": ROLES, "range": ["#222222", "#222222", "#D55E00"]}
    fill = {"domain": ROLES, "range": ["#222222", "#FFFFFF", "#D55E00"]}
    shape = {"domain": ROLES, "range": ["circle", "circle", "diamond"]}
    return alt.Chart(minima).mark_point(size=80, opacity=1.0).encode(
        x=log_x("budget_flops:Q", "Training compute C (FLOPs)"),
        y=y,
        stroke=alt.Stroke("role:N", scale=alt.Scale(**by_role), title="Minimum"),
        fill=alt.Fill("role:N", scale=alt.Scale(**fill), title="Minimum"),
        shape=alt.Shape("role:N", scale=alt.Scale(**shape), title="Minimum"),
        tooltip=["budget_flops", field, "flags"],
    )


def power_law_chart(field, quantity, name):
    law = power_laws.get(field)
    title = f"{name}: not identified"
    layers = []
    if law:
        rows = [
            {"flops": c, "law": power(law, c), **dict(zip(("low", "high"), interval(found) or []))}
            for c in budgets_along()
            for found in [replicates(quantity, c)]
        ]
        line = alt.Chart(pl.DataFrame(rows))
        if bootstrap:
            layers.append(line.mark_area(color="#0072B2", opacity=0.16).encode(
                x="flops:Q", y=alt.Y("low:Q"), y2="high:Q"
            ))
        layers.append(line.mark_line(color="#0072B2").encode(x="flops:Q", y="law:Q"))
        bounds = law.get("exponent_ci95")
        written = f" [{bounds[0]:.3f}, {bounds[1]:.3f}]" if bounds else ""
        title = f"{name} ∝ C^{law['exponent']:.3f}{written}"
    layers.append(minima_marks(field, log_y(f"{field}:Q", name)))
    return alt.layer(*layers).properties(width=230, height=260, title=title)


alt.hconcat(
    power_law_chart("params_nonvocab", "nonvocab", "N_nv"),
    power_law_chart("params_vocab", "vocab", "N_v"),
    power_law_chart("tokens", "tokens", "D"),
)
