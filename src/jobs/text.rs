//! The captions of a data set as vectors.

use std::path::PathBuf;

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use crate::plan::{Plan, TextJob, text_peak_bytes};
use crate::sweep::Stage;
use crate::text::{self, TextError};

/// Embeds every caption of the data once.
pub struct Text;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Text);

impl Kind for Text {
    fn word(&self) -> &'static str {
        "text"
    }

    fn plural(&self) -> &'static str {
        "text"
    }

    fn role(&self) -> &'static str {
        "the embedding of captions"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("text").join(id)
    }

    fn product(&self) -> &'static str {
        "vectors.safetensors"
    }

    fn spec(&self, _: &str) -> PathBuf {
        PathBuf::from("sweep.yaml")
    }

    fn stage(&self) -> Stage {
        Stage::Inputs
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        let job = plan.text.iter().map(|text| Job {
            id: JobId::new(KIND, text.id()),
            label: "captions".to_string(),
            cost: 0.0,
            peak_bytes: text_peak_bytes(&text.spec, &plan.data),
            needs: Vec::new(),
        });
        job.collect()
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let (spec, source) = (assignment.sweep()?.text, assignment.source()?);
        let encoder = text::encoder(&spec)?;
        let found = TextJob::new(&spec, source.digest(), encoder.digest());
        if let Some(file) = spec.path.filter(|_| found.id() != assignment.job.id) {
            return Err(TextError::Changed { file }.into());
        }
        text::embed(&*encoder, &*source, &assignment.product())?;
        Ok(Outcome::Done)
    }
}
