//! Which law to believe, and what its intervals hold.

use serde::{Deserialize, Serialize};

use super::bootstrap::{Bootstrap, Sources};
use super::joint::{JointLaw, Moves, fit_joint, replicates};
use super::minima::{Grid, extent};
use super::ranking::{Candidate, ForecastError, Recommended, Rows, recommended};
use super::stats::interval95;
use super::{FitOptions, LackOfFit, LawSample, Laws, TokenizerNoise, Validated};

/// Replicates of the joint law at most: each is a fit of its own.
const JOINT_REPLICATES: usize = 200;
/// Replicates by which a part of an interval is told.
const PART_REPLICATES: usize = 100;

/// How far laws are to be believed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Judgement {
    /// The law that predicts best.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recommended: Option<Recommended>,
    /// How its misses grow with the distance from its fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecast_error: Option<ForecastError>,
    /// One smooth loss over all cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointLaw>,
    pub lack_of_fit: Vec<LackOfFit>,
    /// The scatter of tokenizers; absent where each vocabulary has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokenizer_noise: Option<TokenizerNoise>,
    /// What the intervals of the exponents are made of.
    pub interval_parts: Vec<IntervalPart>,
    /// Forecasts that runs have tested.
    pub validations: Vec<Validated>,
    /// What the runs tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tried: Option<Tried>,
}

/// The extent of the runs that laws rest on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// The smallest and the largest N_nv, or N.
    pub sizes: [f64; 2],
    /// The smallest and the largest V; zeros where it is not known.
    pub vocabularies: [f64; 2],
    /// Distinct tokens of the training split, where they are known.
    pub unique_tokens: Option<f64>,
    /// The most passes over them.
    pub epochs: Option<f64>,
}

impl Tried {
    /// Of some cells.
    pub(super) fn of(grids: &[Grid]) -> Self {
        let cells = || grids.iter().flat_map(|grid| &grid.cells);
        let range = |(low, high)| [low, high];
        let unique = cells().filter_map(|cell| cell.unique_tokens);
        let epochs = cells().filter_map(|cell| Some(cell.tokens / cell.unique_tokens?));
        Self {
            sizes: range(extent(cells().map(|cell| cell.params_nonvocab))),
            vocabularies: range(extent(cells().map(|cell| cell.n_vocab))),
            unique_tokens: unique.reduce(f64::max),
            epochs: epochs.reduce(f64::max),
        }
    }
}

/// The interval of an exponent, had it one reason alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntervalPart {
    /// `runs`, `tokenizers`, `misfit`, `method`.
    pub part: String,
    /// Of N_nv's exponent, or N's.
    pub exponent_nonvocab: Option<[f64; 2]>,
    pub exponent_vocab: Option<[f64; 2]>,
    pub exponent_tokens: Option<[f64; 2]>,
    pub slope_per_decade: Option<[f64; 2]>,
}

/// The recommendation over all budgets, measured minima beside each grid.
pub(super) fn rank(rows: &Rows, method: crate::sweep::MinimumMethod) -> Recommended {
    recommended(rows.scores(), method, rows.grids.len())
}

/// The joint law of the recommended kind through some budgets, with its replicates where it is the one
/// to believe.
pub(super) fn joint(
    grids: &[Grid],
    law: Candidate,
    moves: &Moves,
    options: &FitOptions,
) -> Option<JointLaw> {
    let noise = moves.noise.map(|noise| noise.sd);
    let mut joint = fit_joint(grids, noise, law == Candidate::JointRepeats)?;
    if law.is_joint() {
        let count = options.bootstrap.min(JOINT_REPLICATES);
        joint.bootstrap = replicates(&joint, grids, moves, count);
    }
    Some(joint)
}

/// What the intervals of the exponents would be for each reason alone.
pub(super) fn interval_parts(bootstrap: &Bootstrap) -> Vec<IntervalPart> {
    let none = Sources::NONE;
    let parts = [
        ("runs", Sources { runs: true, ..none }, true),
        ("tokenizers", Sources { tokenizers: true, ..none }, bootstrap.tokenizers.is_some()),
        ("misfit", Sources { misfit: true, ..none }, bootstrap.misfit > 1.0),
        ("method", Sources { method: true, ..none }, bootstrap.admissible.len() > 1),
    ];
    let known = parts.into_iter().filter(|(.., known)| *known);
    known.map(|(part, sources, _)| interval_part(part, bootstrap, sources)).collect()
}

fn interval_part(part: &str, bootstrap: &Bootstrap, sources: Sources) -> IntervalPart {
    let count = bootstrap.options.bootstrap.min(PART_REPLICATES);
    let options = FitOptions { bootstrap: count, ..bootstrap.options.clone() };
    let alone = Bootstrap { sources, options: &options, ..bootstrap.clone() };
    let replicates = alone.replicates();
    let samples: Vec<LawSample> =
        replicates.iter().filter_map(|replicate| Some(replicate.laws?.sample)).collect();
    let interval =
        |of: fn(&LawSample) -> f64| interval95(&samples.iter().map(of).collect::<Vec<_>>());
    IntervalPart {
        part: part.to_string(),
        exponent_nonvocab: interval(|s| s.exponent_nonvocab),
        exponent_vocab: interval(|s| s.exponent_vocab),
        exponent_tokens: interval(|s| s.exponent_tokens),
        slope_per_decade: interval(|s| s.loss_slope_per_decade),
    }
}

impl Laws {
    /// The law to believe; the log law where none was ranked.
    pub fn recommended_law(&self) -> Candidate {
        self.judgement.recommended.as_ref().map_or(Candidate::Log, |recommended| recommended.law)
    }
}
