//! [`ScoresSpec`]: how motions of runs are made and scored.

use super::error::{KeyProblem, failed};
use crate::units::section;

section! {
    /// The `scores` section: how the motions of a run are made and scored by the sweep's evaluator.
    ///
    /// The numbers of repeats, texts and motions are those of the published tables.
    pub struct ScoresSpec {
        /// Conditions, as `n_vocab == 512 and budget >= 1e12`; runs that meet one of them are scored, and
        /// all where there is none.
        only: Vec<String> = Vec::new(), unless "Vec::is_empty";
        /// How often a motion of every test clip's caption is made.
        repeats: usize = 20;
        /// How far motions are moved away from those without text; `autoregressive` knows no guidance and is
        /// scored without.
        guidance: f64 = 0.0;
        /// How far a tokenizer with language follows the caption when it decodes.
        detokenizer_guidance: f64 = 0.0;
        /// What logits are divided by; 0 takes the likeliest code.
        temperature: f64 = 1.0;
        /// Codes are drawn among the likeliest so many.
        top_k: Option<usize> = None, unless "Option::is_none";
        /// Codes are drawn among the likeliest that together hold this share.
        top_p: Option<f64> = None, unless "Option::is_none";
        /// `masked`: rounds in which codes are shown.
        rounds: usize = 10;
        /// Captions that MultiModality is measured on; 0 leaves it out.
        multimodal_captions: usize = 96;
        /// Motions of each of them.
        multimodal_motions: usize = 30;
        /// Motions of a run that are kept as files, in `samples/<run>/scored`; those of the first repeat.
        samples: usize = 16;
        /// Of motions, pools and pairs.
        seed: u64 = 0;
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
        failed([
            (self.repeats > 0, "repeats", "must be at least 1"),
            (self.rounds > 0, "rounds", "must be at least 1"),
            (self.guidance >= 0.0, "guidance", "must not be negative"),
            (self.detokenizer_guidance >= 0.0, "detokenizer_guidance", "must not be negative"),
            (self.temperature >= 0.0, "temperature", "must not be negative"),
            (self.top_k != Some(0), "top_k", "must be at least 1"),
            (share, "top_p", "lies in (0, 1]"),
            (multimodal, "multimodal_motions", "two motions of a caption differ: at least 2"),
        ])
    }
}
