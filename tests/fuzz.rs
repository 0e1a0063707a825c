//! Each reader of files meets inputs that nobody meant to write: it reads them, or says in a sentence why not; it
//! does not panic, hang, or take the machine's memory.
//!
//! `ISOFLOP_FUZZ_SECONDS` is the time of each kind, `ISOFLOP_FUZZ_INPUTS` a number of inputs in its place, both with
//! a fresh seed; `ISOFLOP_FUZZ_SEED` is the seed, or `SEED:INPUT` for one input alone. A failure tells all of them.

#[path = "fuzz/harness.rs"]
mod harness;
#[path = "fuzz/kinds/mod.rs"]
mod kinds;
#[path = "fuzz/limits.rs"]
mod limits;
#[path = "fuzz/mutate.rs"]
mod mutate;
#[path = "fuzz/sizes.rs"]
mod sizes;
#[path = "fuzz/tensors.rs"]
mod tensors;

#[global_allocator]
static ALLOCATOR: limits::Counted = limits::Counted;

/// A test a kind.
macro_rules! kinds {
    ($($test:ident: $kind:expr,)*) => {
        /// Every kind of file that is read.
        const KINDS: &[harness::Kind] = &[$($kind),*];

        $(#[test]
        fn $test() {
            harness::fuzz(&$kind);
        })*
    };
}

kinds! {
    no_bvh_file_breaks_its_reader: kinds::motion::BVH,
    no_array_breaks_its_reader: kinds::motion::NPY,
    no_bvh_file_breaks_an_import: kinds::motion::IMPORT,
    no_map_of_joints_breaks_its_reader: kinds::motion::MAP,
    no_folder_of_captions_breaks_its_reader: kinds::motion::FOLDER,
    no_store_of_codes_breaks_its_reader: kinds::models::CODES,
    no_store_of_vectors_breaks_its_reader: kinds::models::VECTORS,
    no_file_of_embeddings_breaks_its_reader: kinds::models::EMBEDDINGS,
    no_tokenizer_breaks_its_reader: kinds::models::TOKENIZER,
    no_weights_of_a_tokenizer_break_their_reader: kinds::models::TOKENIZER_WEIGHTS,
    no_evaluator_breaks_its_reader: kinds::models::EVALUATOR,
    no_weights_of_an_evaluator_break_their_reader: kinds::models::EVALUATOR_WEIGHTS,
    no_codes_of_a_clip_break_their_reader: kinds::models::CLIP_CODES,
    no_sweep_file_breaks_its_reader: kinds::sweeps::SWEEP,
    no_profile_breaks_its_reader: kinds::sweeps::PROFILE,
    no_result_of_a_trainer_breaks_its_reader: kinds::runs::RESULT,
    no_line_of_a_trainer_breaks_its_reader: kinds::runs::LINES,
    no_record_breaks_its_reader: kinds::runs::RECORD,
    no_table_of_runs_breaks_its_reader: kinds::runs::RUNS_CSV,
    no_parquet_of_runs_breaks_its_reader: kinds::runs::RUNS_PARQUET,
    no_table_breaks_a_fit: kinds::tables::CSV,
    no_parquet_breaks_a_fit: kinds::tables::PARQUET,
    no_expression_breaks_a_table: kinds::tables::EXPRESSION,
    no_laws_break_a_prediction: kinds::laws::LAWS,
    no_laws_break_a_figure: kinds::laws::FIGURES,
}

/// Inputs that once failed, below `tests/fixtures/fuzz`, in a folder a kind.
#[test]
fn inputs_that_once_failed_are_read_or_refused() {
    KINDS.iter().for_each(harness::replay);
}
