//! [`Metrics`]: how well a run did, by name.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer, Serialize};

use super::facts::LOSSES;

/// How well a run did: values by name. A metric that nobody declared is kept like the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Metrics(BTreeMap<Cow<'static, str>, f64>);

impl Metrics {
    /// The value of a metric; `None` where the run was not measured so.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// Adds a metric, or replaces it.
    pub fn set(&mut self, name: impl Into<Cow<'static, str>>, value: f64) {
        self.0.insert(name.into(), value);
    }

    /// Every metric, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, value)| (name.as_ref(), *value))
    }

    /// Whether a loss is among them.
    pub(super) fn have_a_loss(&self) -> bool {
        LOSSES.iter().any(|name| self.0.contains_key(*name))
    }
}

impl<N: Into<Cow<'static, str>>> FromIterator<(N, f64)> for Metrics {
    fn from_iter<I: IntoIterator<Item = (N, f64)>>(metrics: I) -> Self {
        Self(metrics.into_iter().map(|(name, value)| (name.into(), value)).collect())
    }
}

impl<'de> Deserialize<'de> for Metrics {
    /// A null is a metric that was not measured.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let metrics = BTreeMap::<String, Option<f64>>::deserialize(deserializer)?;
        Ok(metrics.into_iter().filter_map(|(name, value)| Some((name, value?))).collect())
    }
}
