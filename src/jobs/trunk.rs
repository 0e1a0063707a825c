//! A model trained up to a point where runs branch off.

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::assignment::{Assignment, Outcome};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::job::Job;
use super::kind::{JobKind, Kind};
use super::training::{Opened, share_done, trunk_state};
use super::{text, tokens};
use crate::files::{FileError, atomic, read_if_there};
use crate::generator;
use crate::plan::{Plan, Trunk as TrunkSpec};
use crate::progress::beats;
use crate::spec::ModelShape;
use crate::sweep::Stage;

/// Trains a trunk, from the one that it goes on from, up to where runs branch off.
pub struct Trunk;

/// As a kind of job.
pub const KIND: JobKind = JobKind::from_static(&Trunk);

impl Kind for Trunk {
    fn word(&self) -> &'static str {
        "trunk"
    }

    fn plural(&self) -> &'static str {
        "trunks"
    }

    fn role(&self) -> &'static str {
        "its trunk"
    }

    fn folder(&self, id: &str) -> PathBuf {
        PathBuf::from("trunks").join(id)
    }

    fn product(&self) -> &'static str {
        "state.safetensors"
    }

    fn spec(&self, id: &str) -> PathBuf {
        self.folder(id).join("job.json")
    }

    fn stage(&self) -> Stage {
        Stage::Train
    }

    fn jobs(&self, plan: &Plan) -> Vec<Job> {
        plan.trunks.iter().map(job).collect()
    }

    /// Which trunk a trunk goes on from depends on the sweep's budgets; its result does not. So the
    /// spec is written again each time.
    fn prepare(
        &self,
        plan: &Plan,
        folder: &ResultsFolder,
        _: &mut dyn FnMut(String),
    ) -> Result<(), FileError> {
        let path = |trunk: &TrunkSpec| folder.file(self.spec(&trunk.trunk_id));
        plan.trunks.iter().try_for_each(|trunk| atomic::write_json(&path(trunk), trunk))
    }

    fn share_done(&self, folder: &ResultsFolder, id: &str) -> f64 {
        let job = JobId::new(KIND, id);
        let trunk: Option<TrunkSpec> = read_if_there(&folder.spec(&job)).ok().flatten();
        trunk
            .and_then(|trunk| share_done(folder, &job, &trunk.spec, trunk.from.as_deref()))
            .unwrap_or(0.0)
    }

    fn work(&self, assignment: &Assignment) -> Result<Outcome> {
        let TrunkSpec { spec, from, .. } = assignment.spec()?;
        let before = match from {
            Some(id) => Some(
                trunk_state(assignment.folder, &id)
                    .with_context(|| format!("the spec of trunk {id} is missing"))?,
            ),
            None => None,
        };
        let opened = Opened::new(assignment, &spec, before)?;
        let state = assignment.product();
        let place = assignment.place();
        let mut beats = beats(&place, assignment.stop);
        let trained =
            opened.train(|training| generator::train_trunk(training, &state, &mut beats))?;
        if trained.is_none() {
            return Ok(Outcome::Stopped);
        }
        assignment.remove_checkpoint()?;
        Ok(Outcome::Done)
    }
}

fn job(trunk: &TrunkSpec) -> Job {
    let TrunkSpec { trunk_id, spec, from, flops } = trunk;
    let data = [(tokens::KIND, &spec.tokenizer_id), (text::KIND, &spec.text_id)];
    let needs = data.into_iter().chain(from.iter().map(|id| (KIND, id)));
    let ModelShape { n_layer, d_model, .. } = *spec.shape();
    Job {
        id: JobId::new(KIND, trunk_id),
        label: format!(
            "L{n_layer} d{d_model} V{} seed {} to step {}",
            spec.n_vocab(),
            spec.seed,
            spec.steps
        ),
        cost: *flops,
        peak_bytes: spec.generator.peak_bytes(&spec.codes, spec.batch_tokens),
        needs: needs.map(|(kind, id)| JobId::new(kind, id)).collect(),
    }
}
