//! [`IsoFlopPoint`]: a run as input of the laws, its [`Metric`], and values [`PerQuantity`] of a
//! configuration.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// One finished run as the laws see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IsoFlopPoint {
    pub run_id: String,
    pub seed: u64,
    /// The declared budget: runs are grouped by it.
    pub budget_flops: f64,
    /// The FLOPs of the run by the rule of the fit.
    pub flops: f64,
    /// N_nv.
    pub params_nonvocab: f64,
    /// N_v = V·d.
    pub params_vocab: f64,
    /// V.
    pub n_vocab: f64,
    /// D.
    pub tokens: f64,
    /// The kind of loss.
    pub metric: Metric,
    /// The loss; lower is better. L_u is in nats, and 0 for the unigram model.
    pub loss: f64,
    /// The relative weight of the run in means and fits; 1 by default.
    pub weight: f64,
    /// Facts that no law contains, but that some use to judge the runs.
    #[serde(default)]
    pub about: RunFacts,
}

/// Further facts of a run; a table made elsewhere has none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunFacts {
    /// Blocks of the model.
    pub n_layer: Option<usize>,
    /// The tokenizer that made its codes, by id.
    pub tokenizer: Option<String>,
    /// Distinct tokens of its training data: a run of more tokens repeats them.
    pub unique_tokens: Option<f64>,
    /// The fraction of the training split that it used, 1 for all.
    #[serde(default)]
    pub share: Option<f64>,
    /// The loss on each block of the test split, minus their mean; empty if unknown. Blocks have no recording in
    /// common, and are the same for all runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by_block: Vec<f64>,
}

impl IsoFlopPoint {
    /// The fraction of the training split that it used; 1 if unknown.
    pub fn share(&self) -> f64 {
        self.about.share.unwrap_or(1.0)
    }
}

/// Whether a table separates vocabulary and other parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parameters {
    /// N_nv and N_v each have a column.
    #[default]
    Split,
    /// Only N is known. In points and minima it is stored as N_nv, with N_v and V 0; the laws have a separate
    /// field, [`PowerLaws::params`](crate::laws::PowerLaws::params).
    Total,
}

impl Parameters {
    /// The symbol of a model's size.
    pub fn size(self) -> &'static str {
        match self {
            Self::Split => "N_nv",
            Self::Total => "N",
        }
    }
}

// Which loss a point holds.

/// L_u, the metric that laws are fitted to by default.
pub const LOSS_NORMALISED: &str = "loss_normalised";

/// The name of the loss of points and laws: a metric of records, or a column or an expression of a
/// table made elsewhere.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub struct Metric(Arc<str>);

impl Metric {
    /// The metric of a name.
    pub fn new(name: &str) -> Self {
        Self(name.into())
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.0
    }

    /// What it is in, if that is known.
    pub fn unit(&self) -> Option<&'static str> {
        match self.name() {
            LOSS_NORMALISED | "loss_nats" => Some("nats"),
            "nats_per_frame" => Some("nats a frame"),
            "nats_per_second" => Some("nats a second"),
            _ => None,
        }
    }

    /// A number of it for a person: `0.012 nats`, or without a unit where none is known.
    pub fn said(&self, number: &str) -> String {
        self.unit().map_or_else(|| number.to_string(), |unit| format!("{number} {unit}"))
    }
}

impl Default for Metric {
    /// [`LOSS_NORMALISED`].
    fn default() -> Self {
        Self::new(LOSS_NORMALISED)
    }
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl From<String> for Metric {
    fn from(name: String) -> Self {
        Self(name.into())
    }
}

impl From<Metric> for String {
    fn from(metric: Metric) -> Self {
        metric.0.as_ref().to_string()
    }
}

// One value for each of N, N_nv, N_v, V and D.

/// A value for each quantity of a configuration; absent if unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PerQuantity<T> {
    /// N, if N_nv and N_v are not separate; then the next three are absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params: Option<T>,
    /// N_nv.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params_nonvocab: Option<T>,
    /// N_v.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub params_vocab: Option<T>,
    /// V, the number of codes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_vocab: Option<T>,
    /// D, in tokens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokens: Option<T>,
}

impl<T> Default for PerQuantity<T> {
    fn default() -> Self {
        Self {
            params: None,
            params_nonvocab: None,
            params_vocab: None,
            n_vocab: None,
            tokens: None,
        }
    }
}

impl<T> PerQuantity<T> {
    /// The known values with their symbols, in the order of a table.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &T)> {
        let all = [
            ("N", &self.params),
            ("N_nv", &self.params_nonvocab),
            ("N_v", &self.params_vocab),
            ("V", &self.n_vocab),
            ("D", &self.tokens),
        ];
        all.into_iter().filter_map(|(symbol, value)| Some((symbol, value.as_ref()?)))
    }

    /// The value of a symbol.
    pub fn of(&self, symbol: &str) -> Option<&T> {
        self.named().find_map(|(own, value)| (own == symbol).then_some(value))
    }

    /// The size: N_nv, or N.
    pub fn size(&self) -> Option<&T> {
        self.params_nonvocab.as_ref().or(self.params.as_ref())
    }

    /// Another value in place of each.
    pub fn map<U>(&self, mut of: impl FnMut(&T) -> U) -> PerQuantity<U> {
        PerQuantity {
            params: self.params.as_ref().map(&mut of),
            params_nonvocab: self.params_nonvocab.as_ref().map(&mut of),
            params_vocab: self.params_vocab.as_ref().map(&mut of),
            n_vocab: self.n_vocab.as_ref().map(&mut of),
            tokens: self.tokens.as_ref().map(of),
        }
    }

    /// With the size under the name that the laws have for it: N_nv, or N and no vocabulary.
    pub fn under(self, parameters: Parameters) -> Self {
        match parameters {
            Parameters::Split => self,
            Parameters::Total => {
                Self { params: self.params_nonvocab, tokens: self.tokens, ..Self::default() }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::file::Laws;
    use crate::laws::fit::{approach1, fit, fit_parametric};
    use crate::laws::input::{FitError, FitOptions};
    use crate::laws::parametric::{Form, ParametricOptions};
    use crate::laws::published::scamo;
    use crate::laws::simulated::SWEEP;

    #[test]
    fn laws_name_the_metric_of_their_points_and_older_ones_are_of_the_normalised_loss() {
        let mut points = SWEEP.points();
        points.iter_mut().for_each(|point| point.metric = Metric::new("nats_per_second"));
        let laws = fit(&points, &FitOptions { bootstrap: 0, ..FitOptions::default() }).unwrap();
        assert_eq!(laws.metric.name(), "nats_per_second");
        let mut file = serde_json::to_value(&laws).unwrap();
        assert_eq!(file["metric"], "nats_per_second");
        assert_eq!(serde_json::from_value::<Laws>(file.clone()).unwrap(), laws);
        file.as_object_mut().unwrap().remove("metric");
        assert_eq!(serde_json::from_value::<Laws>(file).unwrap().metric, Metric::default());
        assert_eq!(scamo().metric.name(), "loss_normalised");
    }

    #[test]
    fn points_of_two_metrics_are_not_fitted_together() {
        let mut points = SWEEP.points();
        points[3].metric = Metric::new("nats_per_frame");
        let errors = [
            fit(&points, &FitOptions::default()).unwrap_err(),
            approach1(&points, &FitOptions::default()).unwrap_err(),
            fit_parametric(&points, &ParametricOptions::of(Form::Approach3)).unwrap_err(),
        ];
        for error in errors {
            assert!(
                matches!(&error, FitError::Metrics { run_id, .. } if *run_id == points[3].run_id)
            );
            assert!(error.to_string().contains("nats_per_frame as its loss"), "{error}");
        }
    }
}
