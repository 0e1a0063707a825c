def log_loss(law, flops):
    return law["slope_per_decade"] * math.log10(flops) + law["intercept"]


def floor_loss(law, flops):
    return law["floor"] + law["coefficient"] * (flops / reference) ** -law["exponent"]


def describe(name, law):
    error = law.get("held_out_error")
    written = "none held out" if error is None else f"{error:+.4f} nats at the held-out budget"
    print(f"{name}: R² = {law['r2']:.4f}, error {written}")


evaluate = {"log": log_loss, "floor": floor_loss}
names = {"log": "log law", "floor": "power law with a floor"}
fitted = {key: loss_laws[key] for key in evaluate if loss_laws.get(key)}
for key, law in fitted.items():
    describe(names[key], law)

rows = [
    {"law": names[key], "flops": c, "loss": evaluate[key](law, c)}
    for key, law in fitted.items()
    for c in budgets_along()
]
layers = []
if rows:
    drawn = [names[key] for key in fitted]
    colours = {"log": "#0072B2", "floor": "#009E73"}
    style = alt.Scale(domain=drawn, range=[colours[key] for key in fitted])
    dash = alt.Scale(domain=drawn, range=[[1, 0] if key == "log" else [6, 4] for key in fitted])
    layers.append(
        alt.Chart(pl.DataFrame(rows)).mark_line().encode(
            x="flops:Q",
            y="loss:Q",
            color=alt.Color("law:N", scale=style, title="Law"),
            strokeDash=alt.StrokeDash("law:N", scale=dash, title="Law"),
        )
    )
loss_axis = alt.Y("loss_normalised:Q", scale=LOSS, title="Normalised loss L_u (nats)")
layers.append(minima_marks("loss_normalised", loss_axis))
alt.layer(*layers).properties(width=620, height=360).interactive()
