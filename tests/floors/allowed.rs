//! The circles of files that are left.

/// Files that need one another and cannot well be had apart, and why.
pub const ALLOWED: [(&[&str], &str); 2] = [
    (
        &[
            "src/figures/mod.rs",
            "src/figures/isoflop_parabolas.rs",
            "src/figures/loss_vs_budget.rs",
            "src/figures/loss_vs_data.rs",
            "src/figures/loss_vs_flops.rs",
            "src/figures/loss_vs_vocab.rs",
            "src/figures/power_laws.rs",
            "src/figures/tokenizers.rs",
            "src/figures/vocab_vs_nonvocab.rs",
            "src/figures/words.rs",
            "src/figures/write.rs",
        ],
        "the list of figures, and what each is drawn from",
    ),
    (
        &[
            "crates/model/src/ops/own/lanes.rs",
            "crates/model/src/ops/own/x86.rs",
        ],
        "a macro that chooses among instruction sets, each of which has lanes",
    ),
];
