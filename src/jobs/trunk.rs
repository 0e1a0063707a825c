//! A model trained up to a point where runs branch off.

use anyhow::{Context, Result};

use super::assignment::{Assignment, Outcome};
use super::training::{Opened, trunk_state};
use crate::generator;
use crate::plan::Trunk;
use crate::progress::beats;

/// Trains a trunk, from the one that it goes on from, up to where runs branch off.
pub fn work(assignment: &Assignment) -> Result<Outcome> {
    let Trunk { spec, from, .. } = assignment.spec()?;
    let state_of = |id: &String| {
        trunk_state(assignment.folder, id)
            .with_context(|| format!("the spec of trunk {id} is missing"))
    };
    let opened = Opened::new(assignment, &spec, from.as_ref().map(state_of).transpose()?)?;
    let state = assignment.product();
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    let trained = opened.train(|training| generator::train_trunk(training, &state, &mut beats))?;
    if trained.is_none() {
        return Ok(Outcome::Stopped);
    }
    assignment.done()
}
