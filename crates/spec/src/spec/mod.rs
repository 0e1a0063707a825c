//! Descriptions of what is trained: plain data, closed, hashable, free of burn.
//!
//! A kind is a variant of a tagged enum: [`GeneratorSpec`], [`ArchitectureSpec`], [`QuantizerSpec`],
//! [`TextSpec`]. What depends on the kind is asked of the spec; no other module matches on it but
//! the one that builds it.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::spec::{levels_for, n_codes};
//!
//! // ScaMo's 2^8 codes are 8 · 6 · 5.
//! let levels = levels_for(256).expect("a size of Table 8");
//! assert_eq!((levels, n_codes(levels)), (&[8, 6, 5][..], 240));
//! ```

mod architecture;
mod data;
mod error;
mod evaluator;
pub mod generator;
mod grid;
mod id;
mod language;
mod levels;
mod plateau;
mod precision;
mod quantizer;
mod representation;
mod run;
mod scores;
mod share;
mod text;
mod tokenizer;
mod tokenizer_trainer;
mod tokenizer_training;
mod transformer;

use crate::units::number::plain;

pub use architecture::{ArchitectureSpec, BegunFrom, Codes, ConvolutionalSpec, PatchSpec};
pub use data::{BrokenFiles, Clips, DataSection, DataSource, MemberSection, Origin};
pub use error::{KeyProblem, SpecError};
pub use evaluator::{
    EvaluatorKind, EvaluatorSection, EvaluatorSpec, MatchingSpec, Mismatches, MotionClipSpec,
    NetworksSpec,
};
pub use generator::flops;
pub use generator::{
    ClipShape, Context, Ffn, FlopsPerToken, FlopsRule, GeneratorKind, GeneratorSpec, MaskedSpec,
    ModelShape, ParamCounts, Places, Pricing, Scales, ScalewiseSpec, TARGETS_PER_PASS,
    exact_of_clip,
};
pub use grid::{Grid, Length, Scale};
pub use id::{changed_fields, content_id};
pub use language::{LanguagePlace, LanguageSection, LanguageSpec};
pub use levels::{digits_of_index, index_of_digits, levels_for, n_codes, nominal_sizes};
pub use plateau::Plateau;
pub use precision::Precision;
pub use quantizer::{
    CodebookKind, CodebookSpec, MultiscaleSpec, QuantizerKind, QuantizerSection, QuantizerSpec,
    ResidualSpec, ScaleName, ScaleSpec, VocabularyError,
};
pub use representation::Representation;
pub use run::{RunSpec, TRAINING_REVISION, TokenizerJob, TrainerProgram, is_torch};
pub use scores::ScoresSpec;
pub use share::Share;
pub use text::{TextEncoderKind, TextSpec, TextStates};
pub use tokenizer::TokenizerSpec;
pub use tokenizer_trainer::TokenizerTrainer;
pub use tokenizer_training::{
    TokenizerKind, TokenizerLoss, TokenizerSchedule, TokenizerSection, TokenizerTraining,
};
pub use transformer::{Detokenizer, NormPlacement, Positions, SWIGLU_RATIO, TransformerSpec};

plain!(DataSource, MemberSection, BrokenFiles, Clips);
plain!(Representation, Precision, TextEncoderKind, TextStates, Ffn, FlopsRule);
plain!(EvaluatorKind, Mismatches, LanguagePlace, LanguageSection, Plateau, QuantizerSection);
plain!(TokenizerKind, TokenizerTrainer, TokenizerLoss, TokenizerSchedule, Codes);
plain!(NormPlacement, Positions, Detokenizer);
