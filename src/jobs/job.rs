//! [`Job`]: one thing to do, and what it waits for.

use serde::{Deserialize, Serialize};

use super::id::JobId;

/// One thing to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    pub id: JobId,
    /// For a person.
    pub label: String,
    /// FLOPs, to order jobs and to weigh progress; a rough figure for all that does not train a
    /// generator.
    pub cost: f64,
    /// Memory expected at its peak, in bytes; 0 where that is not known.
    pub peak_bytes: u64,
    /// What must be there first.
    pub needs: Vec<JobId>,
}
