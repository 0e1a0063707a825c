//! [`EvaluatorJob`]: an evaluator to train, which all scores of a sweep are taken by.

use serde::{Deserialize, Serialize};

use super::run_spec::TRAINING_REVISION;
use crate::data::DataFacts;
use crate::spec::{EvaluatorSpec, content_id};

/// One evaluator to train. It hangs on the data alone, so that sweeps that differ in anything else share
/// it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorJob {
    pub revision: u32,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
}

impl EvaluatorJob {
    /// The job of a sweep's `evaluator` section on its data.
    pub fn new(spec: EvaluatorSpec, data: &DataFacts) -> Self {
        Self { revision: TRAINING_REVISION, spec, data_digest: data.digest.clone() }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}
