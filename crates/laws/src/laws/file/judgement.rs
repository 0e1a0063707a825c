//! The reliability of laws, and their errors on budgets left out of the fit.

use serde::{Deserialize, Serialize};

use crate::laws::joint::JointLaw;
use crate::laws::minima::{CrossOptimum, LackOfFit, TiedCells, TriedCells};
use crate::laws::noise::{TestNoise, TokenizerNoise};
use crate::laws::ranking::{ForecastError, Recommended};

/// The reliability of laws.
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
    /// The scatter of tokenizers; absent if each vocabulary has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokenizer_noise: Option<TokenizerNoise>,
    /// The effect of other test clips; absent if it is unknown which were recorded together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test_noise: Option<TestNoise>,
    /// The sources of error in the intervals of the exponents.
    pub interval_parts: Vec<IntervalPart>,
    /// Forecasts that runs have tested.
    pub validations: Vec<Validated>,
    /// Likely errors in all rows of a table, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rows: Vec<String>,
    /// The losses depend on V no more than by chance, so that no exponent of N_v is told.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub vocab_is_chance: bool,
    /// The range of the runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tried: Option<Tried>,
}

/// The extent of the runs that laws rest on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Number of runs and of budgets; 0 in a file without them.
    #[serde(default)]
    pub runs: usize,
    #[serde(default)]
    pub n_budgets: usize,
    /// The smallest and the largest budget; zeros in a file without them.
    #[serde(default)]
    pub budgets: [f64; 2],
    /// The smallest and the largest N_nv, or N.
    pub sizes: [f64; 2],
    /// The smallest and the largest V; zeros if unknown.
    pub vocabularies: [f64; 2],
    /// Layers of every model, where all have as many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub n_layer: Option<usize>,
    /// Distinct tokens of the training split, if known.
    pub unique_tokens: Option<f64>,
    /// The most passes over them.
    pub epochs: Option<f64>,
}

/// The interval of an exponent, had it one reason alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntervalPart {
    /// `runs`, `tokenizers`, `misfit`, `method`, `test split`.
    pub part: String,
    /// The interval of N_nv's exponent, or N's.
    pub exponent_nonvocab: Option<[f64; 2]>,
    pub exponent_vocab: Option<[f64; 2]>,
    pub exponent_tokens: Option<[f64; 2]>,
    pub slope_per_decade: Option<[f64; 2]>,
}

// A forecast and the runs that tested it.

/// A forecast that was registered before its runs, and their result: `validations` of `laws.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Validated {
    pub budget_flops: f64,
    /// The budget over the largest that was fitted.
    pub extrapolation_factor: f64,
    pub predicted: Predicted,
    pub measured: Measured,
    pub inside: Inside,
}

/// The forecast, with 95 % intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Predicted {
    pub loss: Option<f64>,
    pub loss_ci95: Option<[f64; 2]>,
    pub params_nonvocab: Option<f64>,
    pub params_nonvocab_ci95: Option<[f64; 2]>,
    pub params_vocab: Option<f64>,
    pub params_vocab_ci95: Option<[f64; 2]>,
    pub tokens: Option<f64>,
    pub tokens_ci95: Option<[f64; 2]>,
}

/// The best cell that was trained, averaged over its runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub loss: f64,
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    /// Runs of all cells.
    pub runs: usize,
    /// Sizes and vocabularies among them, if they were counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sizes: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vocabularies: Option<usize>,
    /// The range of the cells; absent in an older file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tried: Option<TriedCells>,
    /// The optimum between the cells, if they determine it: the forecast is compared with it instead of the best
    /// cell's N_nv, N_v and D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optimum: Option<CrossOptimum>,
    /// The range that run noise leaves open; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tied: Option<TiedCells>,
    /// Cross-entropy of the best cell in nats per token, if the runs have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_nats: Option<f64>,
}

impl Measured {
    /// N_nv, N_v and D of the optimum, or of the best cell.
    pub fn at(&self) -> [f64; 3] {
        let best = [self.params_nonvocab, self.params_vocab, self.tokens];
        self.optimum.map_or(best, |o| [o.params_nonvocab, o.params_vocab, o.tokens])
    }
}

/// Whether the measured value lies in the interval; absent if there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inside {
    pub loss: Option<bool>,
    pub params_nonvocab: Option<bool>,
    pub params_vocab: Option<bool>,
    pub tokens: Option<bool>,
}

impl Inside {
    /// The symbols of the optimum's quantities outside their intervals.
    pub(in crate::laws) fn outside(&self) -> impl Iterator<Item = &'static str> {
        let of = [("N_nv", self.params_nonvocab), ("N_v", self.params_vocab), ("D", self.tokens)];
        of.into_iter().filter(|(_, inside)| *inside == Some(false)).map(|(name, _)| name)
    }

    /// Whether no judged quantity lies outside its interval.
    pub fn is_whole(&self) -> bool {
        self.loss != Some(false) && self.outside().next().is_none()
    }
}

impl Validated {
    /// A forecast and the measurement.
    pub fn new(
        (budget_flops, extrapolation_factor): (f64, f64),
        predicted: Predicted,
        measured: Measured,
    ) -> Self {
        let tied = |of: fn(&TiedCells) -> [f64; 2]| measured.tied.as_ref().map(of);
        // Neither true nor false if the value lies outside but a tie of it lies inside.
        let holds = |interval: Option<[f64; 2]>, value: f64, tied: Option<[f64; 2]>| {
            let [low, high] = interval?;
            let is_inside = (low..=high).contains(&value);
            let is_open = tied.is_some_and(|tied| tied[0] <= high && tied[1] >= low);
            (is_inside || !is_open).then_some(is_inside)
        };
        // One value alone is the best by default, and the best of cells within the interval lies in it.
        let varied = |values: Option<usize>| values != Some(1);
        let beyond = |tried: Option<[f64; 2]>, interval: Option<[f64; 2]>| {
            let both = tried.zip(interval);
            both.is_none_or(|(tried, interval)| tried[0] < interval[0] || tried[1] > interval[1])
        };
        let sizes = measured.tried.map(|tried| tried.params_nonvocab);
        let vocabularies = measured.tried.map(|tried| tried.params_vocab);
        let [size, vocab, tokens] = measured.at();
        let inside = Inside {
            loss: holds(predicted.loss_ci95, measured.loss, tied(|t| t.loss)),
            params_nonvocab: holds(
                predicted.params_nonvocab_ci95,
                size,
                tied(|t| t.params_nonvocab),
            )
            .filter(|_| varied(measured.sizes))
            .filter(|_| beyond(sizes, predicted.params_nonvocab_ci95)),
            params_vocab: holds(predicted.params_vocab_ci95, vocab, tied(|t| t.params_vocab))
                .filter(|_| varied(measured.vocabularies))
                .filter(|_| beyond(vocabularies, predicted.params_vocab_ci95)),
            tokens: holds(predicted.tokens_ci95, tokens, tied(|t| t.tokens)),
        };
        Self { budget_flops, extrapolation_factor, predicted, measured, inside }
    }

    /// The cross-entropy of the best cell, in nats a token: forecast, by its own entropy of single codes, and
    /// measured.
    pub fn cross_entropy(&self) -> Option<[f64; 2]> {
        let measured = self.measured.loss_nats?;
        Some([self.predicted.loss? + measured - self.measured.loss, measured])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PREDICTED: Predicted = Predicted {
        loss: Some(-5.18),
        loss_ci95: Some([-5.28, -5.08]),
        params_nonvocab: Some(2e4),
        params_nonvocab_ci95: Some([1e4, 4e4]),
        params_vocab: Some(1e5),
        params_vocab_ci95: Some([5e4, 2e5]),
        tokens: Some(1e7),
        tokens_ci95: None,
    };
    const MEASURED: Measured = Measured {
        loss: -5.035,
        params_nonvocab: 3.5e4,
        params_vocab: 1e5,
        n_vocab: 4867.0,
        tokens: 1e7,
        runs: 5,
        sizes: Some(3),
        vocabularies: Some(3),
        tried: None,
        optimum: None,
        tied: None,
        loss_nats: None,
    };
    const BEYOND: (f64, f64) = (3e12, 9.4);

    #[test]
    fn a_forecast_says_whether_it_held() {
        let said = |measured| Validated::new(BEYOND, PREDICTED, measured).sentence().unwrap();
        assert_eq!(
            said(MEASURED),
            "A forecast for 3e12 FLOPs MISSED: L_u -5.180 (95 %: -5.280 to -5.080), and the best of 5 runs measured -5.035."
        );
        assert!(
            said(Measured { loss: -5.1, ..MEASURED })
                .starts_with("A forecast for 3e12 FLOPs held:")
        );
        let larger = said(Measured { params_nonvocab: 5e4, params_vocab: 3e5, ..MEASURED });
        assert!(larger.ends_with("measured -5.035; its N_nv and N_v lie outside."), "{larger}");
    }

    #[test]
    fn an_optimum_between_the_cells_is_judged_in_place_of_the_best_one() {
        let of = |optimum| {
            let measured = Measured { params_nonvocab: 5e4, optimum, ..MEASURED };
            Validated::new(BEYOND, PREDICTED, measured).inside.params_nonvocab
        };
        let optimum = CrossOptimum {
            params_nonvocab: 3.9e4,
            params_vocab: 1e5,
            n_vocab: 4867.0,
            tokens: 1e7,
        };
        assert_eq!([None, Some(optimum)].map(of), [Some(false), Some(true)]);
    }

    #[test]
    fn what_the_runs_did_not_vary_is_not_judged() {
        let of = |vocabularies| {
            let measured = Measured { vocabularies, ..MEASURED };
            Validated::new(BEYOND, PREDICTED, measured).inside
        };
        assert_eq!(of(Some(3)).params_vocab, Some(true));
        assert_eq!(of(Some(1)).params_vocab, None);
        assert_eq!(of(Some(1)).params_nonvocab, Some(true));
    }

    #[test]
    fn cells_that_all_lie_within_the_interval_judge_nothing() {
        let of = |params_nonvocab| {
            let tried = Some(TriedCells { params_nonvocab, params_vocab: [1e4, 4e5] });
            Validated::new(BEYOND, PREDICTED, Measured { tried, ..MEASURED }).inside
        };
        assert_eq!(of([1.2e4, 3.9e4]).params_nonvocab, None, "of 1e4 to 4e4");
        assert_eq!(of([8e3, 3.9e4]).params_nonvocab, Some(true));
        assert_eq!(of([8e3, 3.9e4]).params_vocab, Some(true));
    }

    #[test]
    fn a_tie_within_the_noise_neither_holds_nor_misses() {
        let of = |loss, params_nonvocab| {
            let tied = Some(TiedCells {
                params_nonvocab,
                params_vocab: [1e5; 2],
                tokens: [1e7; 2],
                loss: [loss - 0.05, loss + 0.05],
            });
            let measured = Measured { loss, params_nonvocab: 5e4, tied, ..MEASURED };
            let inside = Validated::new(BEYOND, PREDICTED, measured).inside;
            [inside.loss, inside.params_nonvocab]
        };
        assert_eq!(of(-5.05, [3e4, 5e4]), [None; 2], "of -5.28 to -5.08 and 1e4 to 4e4");
        assert_eq!(of(-5.02, [4.5e4, 5e4]), [Some(false); 2]);
        assert_eq!(of(-5.1, [3e4, 5e4])[0], Some(true));
    }

    #[test]
    fn cross_entropy_is_compared_at_the_best_cell() {
        let measured = Measured { loss_nats: Some(2.965), ..MEASURED };
        let [forecast, found] =
            Validated::new(BEYOND, PREDICTED, measured).cross_entropy().unwrap();
        assert!((forecast - 2.82).abs() < 1e-9 && found == 2.965, "{forecast}");
    }

    #[test]
    fn runs_within_the_fit_test_no_forecast() {
        assert_eq!(Validated::new((1e10, 0.3), PREDICTED, MEASURED).sentence(), None);
    }
}
