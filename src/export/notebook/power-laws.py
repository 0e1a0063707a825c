ROLES = ["fitted", "flagged", "held out"]
reference = laws.get("reference_flops")
answer = laws.get("answer") or {}
exponents, path = answer.get("exponents") or {}, answer.get("path") or []
print(answer.get("formula", ""), answer.get("verdict", ""), sep="\n")


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


def optimum_chart(field, name):
    """The optimum along the budgets by the recommended law, beside the minima."""
    exponent = exponents.get(field) or {}
    title = f"{name}: not determined"
    rows = [
        {"flops": at["budget_flops"], "law": at[field]["value"],
         **dict(zip(("low", "high"), at[field].get("ci95") or []))}
        for at in path
        if at.get(field) and exponent.get("value") is not None
    ]
    layers = []
    if rows:
        line = alt.Chart(pl.DataFrame(rows))
        if "low" in rows[0]:
            layers.append(line.mark_area(color="#0072B2", opacity=0.16).encode(
                x="flops:Q", y=alt.Y("low:Q"), y2="high:Q"
            ))
        layers.append(line.mark_line(color="#0072B2").encode(x="flops:Q", y="law:Q"))
        bounds = exponent.get("ci95")
        written = f" [{bounds[0]:.3f}, {bounds[1]:.3f}]" if bounds else ""
        title = f"{name} ∝ C^{exponent['value']:.3f}{written}"
    layers.append(minima_marks(field, log_y(f"{field}:Q", name)))
    return alt.layer(*layers).properties(width=230, height=260, title=title)


alt.hconcat(
    optimum_chart("params_nonvocab", "N_nv"),
    optimum_chart("params_vocab", "N_v"),
    optimum_chart("tokens", "D"),
)
