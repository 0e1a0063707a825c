//! [`Metric`]: which loss a point holds.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::file::laws::Laws;
    use crate::laws::fit::approach1::approach1;
    use crate::laws::fit::fit;
    use crate::laws::fit::parametric_laws::fit_parametric;
    use crate::laws::input::error::FitError;
    use crate::laws::input::options::FitOptions;
    use crate::laws::parametric::form::Form;
    use crate::laws::parametric::options::ParametricOptions;
    use crate::laws::published::scamo::scamo;
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
