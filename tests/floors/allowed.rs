//! The circles of files that are left.

/// Files that need one another and cannot well be had apart, and why.
pub const ALLOWED: [(&[&str], &str); 4] = [
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
        &["src/ops/own/lanes.rs", "src/ops/own/x86.rs", "src/ops/own/x86/transpose.rs"],
        "a macro that chooses among instruction sets, each of which has lanes",
    ),
    (
        &[
            "src/tokenizer/architecture.rs",
            "src/tokenizer/convolutional/autoencoder.rs",
            "src/tokenizer/patch/network.rs",
            "src/tokenizer/transformer/decoder.rs",
            "src/tokenizer/transformer/encoder.rs",
        ],
        "the choice among architectures, and the traits that each implements",
    ),
    (
        &[
            "src/tokenizer/quantizer/mod.rs",
            "src/tokenizer/quantizer/codebook.rs",
            "src/tokenizer/quantizer/fsq.rs",
            "src/tokenizer/quantizer/multiscale.rs",
            "src/tokenizer/quantizer/residual_fsq.rs",
            "src/tokenizer/quantizer/residual_vq.rs",
            "src/tokenizer/quantizer/states.rs",
            "src/tokenizer/quantizer/vq.rs",
        ],
        "the choice among quantizers, and the trait that each implements",
    ),
];
