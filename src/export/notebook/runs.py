KEYS = [
    "run_id", "seed", "n_layer", "n_head", "d_model", "n_vocab", "budget_flops",
    "params_nonvocab", "params_vocab", "tokens", "loss_nats", "loss_normalised", "wall_s",
]
table = runs.select(KEYS).sort("budget_flops", "params_nonvocab", "n_vocab", "seed")
table
