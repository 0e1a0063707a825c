//! The captions of a data set as vectors.

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use crate::plan::TextJob;
use crate::text::{self, TextError};

/// Embeds every caption of the data once.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let (spec, source) = (assignment.sweep()?.text, assignment.source()?);
    let encoder = text::encoder(&spec)?;
    let found = TextJob::new(&spec, source.digest(), encoder.digest());
    if let Some(file) = spec.path.filter(|_| found.id() != assignment.job.id) {
        return Err(TextError::Changed { file }.into());
    }
    text::embed(&*encoder, &*source, &assignment.product())?;
    Ok(Outcome::Done)
}
