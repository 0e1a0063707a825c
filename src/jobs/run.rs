//! A finished run and its record.

use anyhow::Result;

use super::assignment::{Assignment, Outcome};
use super::folder::{LOG, MODEL, TEST_CLIPS};
use super::program::{self, TrainerResult};
use super::record::FinishedRun;
use super::training::{Opened, trunk_state};
use crate::files::atomic::{write_json, write_json_lines};
use crate::generator::{self, Trained};
use crate::learn::weights;
use crate::machine::peak_bytes;
use crate::progress::beats;
use crate::spec::RunSpec;

/// Trains a run from where it stands, or has a program of somebody's own do so; its record is
/// written whole, after everything else.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let spec: RunSpec = assignment.spec()?;
    if let Some(trainer) = &spec.trainer {
        if assignment.folder.tokens(&spec.tokenizer_id).exists() {
            Opened::new(assignment, &spec, None)?;
        }
        return program::run_program(assignment, &spec, trainer);
    }
    let trunk = spec.trunk().and_then(|trunk| trunk_state(assignment.folder, &trunk.id()));
    let opened = Opened::new(assignment, &spec, trunk)?;
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = opened.train(|training| generator::train(training, &mut beats))?;
    let Some(trained) = trained else { return Ok(Outcome::Stopped) };
    write_results(assignment, &spec, &opened, trained)?;
    assignment.done()
}

fn write_results(
    assignment: &Assignment,
    spec: &RunSpec,
    opened: &Opened,
    trained: Trained,
) -> Result<()> {
    let place = assignment.place();
    weights::save(&place.join(MODEL), &trained.weights, Default::default())?;
    write_json_lines(&place.join(LOG), &trained.log)?;
    write_json_lines(&place.join(TEST_CLIPS), &trained.test.clips)?;
    let result = TrainerResult {
        device: Some(assignment.device_name.to_string()),
        loss_nats: trained.test.loss_nats,
        loss_normalised: Some(trained.test.loss_normalised),
        normalised_by_scale: trained.test.normalised_by_scale,
        clips: trained.test.clips,
        nats_per_frame: Some(trained.test.nats_per_frame),
        flops_exact: Some(trained.flops_exact),
        peak_bytes: Some(peak_bytes() as f64),
        ..TrainerResult::default()
    };
    let run = FinishedRun {
        folder: assignment.folder,
        id: &assignment.job.id,
        spec,
        tokens: Some(opened.inputs().tokens),
        max_text_tokens: 0,
        ran_s: trained.wall_s,
    };
    Ok(write_json(&assignment.product(), &run.record(&result))?)
}
