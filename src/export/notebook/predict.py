budget = 1e13

largest = max((m["budget_flops"] for m in minima.to_dicts() if m["role"] == "fitted"), default=None)
if largest:
    print(f"C = {budget:.3g} FLOPs, {budget / largest:.3g} times the largest fitted budget")


def show(name, value, found):
    bounds = interval(found)
    written = f"   95 % [{bounds[0]:.4g}, {bounds[1]:.4g}]" if bounds else "   no interval"
    print(f"{name:28} {value:>12.4g}{written}")


quantities = {
    "nonvocab": ("params_nonvocab", "N_nv"),
    "vocab": ("params_vocab", "N_v"),
    "tokens": ("tokens", "D"),
}
predicted = {}
for quantity, (field, name) in quantities.items():
    if power_laws.get(field):
        predicted[quantity] = power(power_laws[field], budget)
        show(name, predicted[quantity], replicates(quantity, budget))
    else:
        print(f"{name:28} {'not identified':>12}")

if loss_laws.get("log"):
    found = [
        sample["loss_slope_per_decade"] * math.log10(budget) + sample["loss_intercept"]
        for sample in bootstrap
    ]
    show("L_u, log law (nats)", log_loss(loss_laws["log"], budget), found)
if loss_laws.get("floor"):
    print(f"{'L_u, floor law (nats)':28} {floor_loss(loss_laws['floor'], budget):>12.4g}")

if len(predicted) == 3:
    params = predicted["nonvocab"] + predicted["vocab"]
    overspend = 6 * params * predicted["tokens"] / budget
    print(f"{'overspend 6(N_nv + N_v)D / C':28} {overspend:>12.4g}")
