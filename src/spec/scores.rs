//! [`ScoresSpec`]: how motions of runs are made and scored.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::KeyProblem;
use crate::units::number;

/// The `scores` section: how the motions of a run are made and scored by the sweep's evaluator.
///
/// The numbers of repeats, texts and motions are those of the published tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScoresSpec {
    /// Conditions, as `n_vocab == 512 and budget >= 1e12`; runs that meet one of them are scored, and
    /// all where there is none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub only: Vec<String>,
    /// How often a motion of every test clip's caption is made.
    #[serde(deserialize_with = "number::count")]
    pub repeats: usize,
    /// How far motions are moved away from those without text; `autoregressive` knows no guidance and is
    /// scored without.
    #[serde(deserialize_with = "number::number")]
    pub guidance: f64,
    /// How far a tokenizer with language follows the caption when it decodes.
    #[serde(deserialize_with = "number::number")]
    pub detokenizer_guidance: f64,
    /// What logits are divided by; 0 takes the likeliest code.
    #[serde(deserialize_with = "number::number")]
    pub temperature: f64,
    /// Codes are drawn among the likeliest so many.
    #[serde(deserialize_with = "number::optional_count", skip_serializing_if = "Option::is_none")]
    pub top_k: Option<usize>,
    /// Codes are drawn among the likeliest that together hold this share.
    #[serde(deserialize_with = "number::optional_number", skip_serializing_if = "Option::is_none")]
    pub top_p: Option<f64>,
    /// `masked`: rounds in which codes are shown.
    #[serde(deserialize_with = "number::count")]
    pub rounds: usize,
    /// Captions that MultiModality is measured on; 0 leaves it out.
    #[serde(deserialize_with = "number::count")]
    pub multimodal_captions: usize,
    /// Motions of each of them.
    #[serde(deserialize_with = "number::count")]
    pub multimodal_motions: usize,
    /// Motions of a run that are kept as files, in `samples/<run>/scored`; those of the first repeat.
    #[serde(deserialize_with = "number::count")]
    pub samples: usize,
    /// Of motions, pools and pairs.
    #[serde(deserialize_with = "number::seed")]
    pub seed: u64,
}

impl Default for ScoresSpec {
    fn default() -> Self {
        Self {
            only: Vec::new(),
            repeats: 20,
            guidance: 0.0,
            detokenizer_guidance: 0.0,
            temperature: 1.0,
            top_k: None,
            top_p: None,
            rounds: 10,
            multimodal_captions: 96,
            multimodal_motions: 30,
            samples: 16,
            seed: 0,
        }
    }
}

impl ScoresSpec {
    /// How a run is scored, whichever runs are: without the conditions, which change no score.
    #[must_use]
    pub fn of_a_run(&self) -> Self {
        Self { only: Vec::new(), ..self.clone() }
    }

    /// What nothing can be scored by.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let multimodal = self.multimodal_captions == 0 || self.multimodal_motions > 1;
        let share = self.top_p.is_none_or(|share| share > 0.0 && share <= 1.0);
        let checks = [
            (self.repeats > 0, "repeats", "must be at least 1"),
            (self.rounds > 0, "rounds", "must be at least 1"),
            (self.guidance >= 0.0, "guidance", "must not be negative"),
            (self.detokenizer_guidance >= 0.0, "detokenizer_guidance", "must not be negative"),
            (self.temperature >= 0.0, "temperature", "must not be negative"),
            (self.top_k != Some(0), "top_k", "must be at least 1"),
            (share, "top_p", "lies in (0, 1]"),
            (multimodal, "multimodal_motions", "two motions of a caption differ: at least 2"),
        ];
        let failed = checks.into_iter().filter(|(holds, ..)| !holds);
        failed.map(|(_, field, problem)| KeyProblem { field, problem, help: None }).collect()
    }
}
