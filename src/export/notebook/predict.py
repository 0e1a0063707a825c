# As `isoflop predict` wrote them; for another budget: isoflop predict C --law RESULTS
prediction_file = RESULTS / "prediction.json"
predictions = json.loads(prediction_file.read_text()) if prediction_file.exists() else []
predictions = predictions if isinstance(predictions, list) else [predictions]
names = {
    "params": "N", "params_nonvocab": "N_nv", "params_vocab": "N_v", "n_vocab": "V", "tokens": "D",
    "loss_normalised": "L_u (nats)",
}

for one in predictions:
    beyond = one["extrapolation_factor"]
    law = one.get("recommended") or one["law"]
    print(f"C = {one['budget_flops']:.3g} FLOPs, {beyond:.3g} times the largest fitted budget, by {law}")
    for field, name in names.items():
        if one.get(field) is None:
            continue
        bounds = one["ci95"].get(field)
        written = f"   95 % [{bounds[0]:.4g}, {bounds[1]:.4g}]" if bounds else "   no interval"
        print(f"  {name:12} {one[field]:>12.4g}{written}")
    for warning in one.get("warnings") or []:
        print("  -", warning)
if not predictions:
    print("no prediction.json: isoflop predict C --law", RESULTS)
