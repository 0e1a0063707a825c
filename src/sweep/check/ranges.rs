//! Numbers of a sweep file or a profile outside the ranges at their fields.

use std::sync::LazyLock;

use schemars::schema_for;
use serde_json::Value as Schema;
use serde_yaml::Value;

use crate::sweep::problem::Problem;
use crate::sweep::sections::{SlurmSection, Sweep};
use crate::units::ranges::outside;

static SWEEP: LazyLock<Schema> = LazyLock::new(|| schema_for!(Sweep).to_value());
static PROFILE: LazyLock<Schema> = LazyLock::new(|| schema_for!(SlurmSection).to_value());

/// Problems of a sweep file, or of a part of one, as written.
pub fn of_sweep(keys: &Value) -> Vec<Problem> {
    problems(&SWEEP, keys)
}

/// Problems of a profile.
pub fn of_profile(keys: &Value) -> Vec<Problem> {
    problems(&PROFILE, keys)
}

fn problems(schema: &Schema, keys: &Value) -> Vec<Problem> {
    outside(schema, keys).into_iter().map(|(path, told)| Problem::value(path, told)).collect()
}
