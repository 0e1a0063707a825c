//! The circles of files that are left.

/// Files that need one another and cannot well be had apart, and why.
pub const ALLOWED: [(&[&str], &str); 8] = [
    (
        &[
            "src/figures/mod.rs",
            "src/figures/isoflop_parabolas.rs",
            "src/figures/loss_vs_budget.rs",
            "src/figures/loss_vs_flops.rs",
            "src/figures/loss_vs_vocab.rs",
            "src/figures/power_laws.rs",
            "src/figures/tokenizers.rs",
            "src/figures/vocab_vs_nonvocab.rs",
            "src/figures/write.rs",
        ],
        "the list of figures, and what each is drawn from",
    ),
    (
        &[
            "src/jobs/assignment.rs",
            "src/jobs/folder.rs",
            "src/jobs/id.rs",
            "src/jobs/job.rs",
            "src/jobs/kind.rs",
            "src/jobs/mend.rs",
            "src/jobs/mod.rs",
            "src/jobs/program/mod.rs",
            "src/jobs/program/result.rs",
            "src/jobs/program/spec.rs",
            "src/jobs/record.rs",
            "src/jobs/run.rs",
            "src/jobs/text.rs",
            "src/jobs/tokenizer.rs",
            "src/jobs/tokens.rs",
            "src/jobs/training.rs",
            "src/jobs/trunk.rs",
            "src/jobs/worker.rs",
        ],
        "a job's id names its kind, and each kind says how it is worked on",
    ),
    (
        &[
            "src/laws/minima/mod.rs",
            "src/laws/minima/akima.rs",
            "src/laws/minima/curve.rs",
            "src/laws/minima/surface.rs",
        ],
        "the choice among methods, and what each gives back",
    ),
    (
        &["src/ops/own/lanes.rs", "src/ops/own/x86.rs", "src/ops/own/x86/transpose.rs"],
        "a macro that chooses among instruction sets, each of which has lanes",
    ),
    (
        &[
            "src/record/cell.rs",
            "src/record/facts.rs",
            "src/record/json.rs",
            "src/record/metrics.rs",
            "src/record/run_record.rs",
        ],
        "a record is made of facts, and each fact is read from a record and written into one",
    ),
    (
        &[
            "src/table/outliers/mod.rs",
            "src/table/outliers/duplicates.rs",
            "src/table/outliers/few_levels.rs",
            "src/table/outliers/off_centre.rs",
            "src/table/outliers/spline.rs",
        ],
        "the choice among stages, and what each gives back",
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
