//! [`RunScores`]: the scores of a run's motions.

use crate::motion::recover_joints;
use crate::record::{Quality, RunRecord};
use crate::scores::MotionScores;
use crate::scores::{Physics, Repeated, physics};
use crate::spec::ScoresSpec;
use serde::{Deserialize, Serialize};

/// The scores of a run's motions, of true motions, and of motions with shuffled captions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunScores {
    pub run_id: String,
    /// Only scores by the same evaluator can be compared.
    pub evaluator_id: String,
    pub spec: ScoresSpec,
    /// The guidance that motions were made with.
    pub guidance: f64,
    /// True motions, and motions of each repeat.
    pub n_clips: usize,
    pub made: MotionScores,
    /// The made motions with one another's captions.
    pub shuffled: MotionScores,
    /// True motions, from themselves.
    pub truth: MotionScores,
    /// FID of one half of the true motions from the other.
    pub halves_fid: Repeated,
    /// True motions through the tokenizer.
    pub reconstructed: MotionScores,
    /// Mean distance of motions of one caption; `None` if it was not asked for.
    pub multimodality: Option<Repeated>,
    /// Bodies of the first repeat, and of the truth.
    pub made_physics: ScoredPhysics,
    pub truth_physics: ScoredPhysics,
    /// Bodies of the true motions through the tokenizer; absent in older files.
    #[serde(default)]
    pub reconstructed_physics: Option<ScoredPhysics>,
}

impl RunScores {
    /// Every score with its name, and the run that it is of.
    pub fn quality(&self, run: RunRecord) -> Quality {
        let Self { made, shuffled, truth, reconstructed, .. } = self;
        let [first, second, third] = made.precision;
        let bodies = [self.made_physics, self.truth_physics].map(|physics| physics.mean);
        let one = |mean| Some(Repeated { mean, half_width: 0.0, repeats: 1 });
        let scores = vec![
            ("fid", Some(made.fid)),
            ("r_precision_1", Some(first)),
            ("foot_skate", one(bodies[0].foot_skate)),
            ("truth_foot_skate", one(bodies[1].foot_skate)),
            ("jerk", one(bodies[0].jerk)),
            ("truth_jerk", one(bodies[1].jerk)),
            ("r_precision_2", Some(second)),
            ("r_precision_3", Some(third)),
            ("matching_distance", Some(made.matching_distance)),
            ("cosine", Some(made.cosine)),
            ("diversity", Some(made.diversity)),
            ("multimodality", self.multimodality),
            ("shuffled_r_precision_1", Some(shuffled.precision[0])),
            ("truth_r_precision_1", Some(truth.precision[0])),
            ("truth_diversity", Some(truth.diversity)),
            ("truth_halves_fid", Some(self.halves_fid)),
            ("reconstructed_fid", Some(reconstructed.fid)),
            ("reconstructed_r_precision_1", Some(reconstructed.precision[0])),
            ("bone_spread_mm", one(bodies[0].bone_spread_mm)),
            ("penetration_mm", one(bodies[0].penetration_mm)),
        ];
        Quality { run, evaluator_id: self.evaluator_id.clone(), guidance: self.guidance, scores }
    }
}

/// Mean physical implausibility of motions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoredPhysics {
    /// Number of motions used: those of four frames or more.
    pub n_motions: usize,
    #[serde(flatten)]
    pub mean: Physics,
}

impl ScoredPhysics {
    /// That of motions, each `[T, 263]` row-major and raw, of `fps` frames per second; those below four
    /// frames are not looked at.
    pub fn of<'a>(motions: impl IntoIterator<Item = &'a [f32]>, fps: f64) -> Self {
        let body = |motion: &[f32]| physics(&recover_joints(motion), fps).ok();
        Self::mean(&motions.into_iter().filter_map(body).collect::<Vec<_>>())
    }

    /// The mean over bodies; zeros if there is none.
    pub fn mean(bodies: &[Physics]) -> Self {
        let n = bodies.len().max(1) as f64;
        let mean = |of: fn(&Physics) -> f64| bodies.iter().map(of).sum::<f64>() / n;
        Self {
            n_motions: bodies.len(),
            mean: Physics {
                foot_skate: mean(|body| body.foot_skate),
                jerk: mean(|body| body.jerk),
                bone_spread_mm: mean(|body| body.bone_spread_mm),
                penetration_mm: mean(|body| body.penetration_mm),
            },
        }
    }
}
