//! [`ReportInput`]: all that a page shows.

use crate::laws::Laws;
use crate::motion::Pose;
use crate::predict::Prediction;
use crate::record::RunRecord;
use crate::tokenizer::TokenizerMetrics;

/// All that a page shows.
pub struct ReportInput<'a> {
    pub name: &'a str,
    /// What `isoflop run` says at its end.
    pub verdict: &'a str,
    /// Absent where the runs bear none.
    pub laws: Option<&'a Laws>,
    /// By rising budgets: what the slider moves over.
    pub predictions: &'a [Prediction],
    pub records: &'a [RunRecord],
    pub samples: &'a [Sample],
    pub tokenizers: &'a [TokenizerMetrics],
    pub figures: &'a [Figure],
    /// The resolved sweep, in YAML.
    pub sweep: &'a str,
    /// Cells that were not run, each with its reason.
    pub dropped: &'a [String],
}

/// A figure of the sweep's folder.
pub struct Figure {
    pub name: String,
    pub svg: String,
}

/// A motion of the study.
pub struct Sample {
    pub caption: String,
    /// The run that made it.
    pub run_id: String,
    pub fps: f64,
    /// Metres.
    pub poses: Vec<Pose>,
    /// The true motion of that caption, where the data are at hand.
    pub truth: Option<Vec<Pose>>,
}
