//! Motions of a sweep's folder, for its page.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use isoflop::data::{self, Split, read_motion};
use isoflop::files::read_if_there;
use isoflop::jobs::{ResultsFolder, frozen_sweep};
use isoflop::motion::{Pose, recover_joints};
use isoflop::plan::demand;
use isoflop::record::RunRecord;
use isoflop::report::Sample;
use serde::Deserialize;

/// Motions that a page shows.
const SHOWN: usize = 6;

/// What is read of `motions.json`.
#[derive(Deserialize)]
struct Made {
    caption: String,
    fps: f64,
}

/// The first motions of the run of the lowest L_u that made some; none where no run did.
pub fn samples(folder: &ResultsFolder, records: &[RunRecord]) -> Result<Vec<Sample>> {
    let mut by_loss: Vec<(&RunRecord, f64)> = records
        .iter()
        .filter_map(|record| Some((record, record.loss_normalised().ok()?)))
        .collect();
    by_loss.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (record, _) in by_loss {
        let run_id = &record.planned.run_id;
        let place = folder.file("samples").join(run_id);
        for place in [place.join("scored"), place] {
            let made: Option<Vec<Made>> = read_if_there(&place.join("motions.json"))?;
            if let Some(made) = made {
                return of_run(folder, run_id, &place, &made);
            }
        }
    }
    Ok(Vec::new())
}

fn of_run(
    folder: &ResultsFolder,
    run_id: &str,
    place: &Path,
    made: &[Made],
) -> Result<Vec<Sample>> {
    let file = |n: usize| place.join(format!("{n}.features.npy"));
    let kept: Vec<(PathBuf, &Made)> =
        made.iter().enumerate().map(|(n, made)| (file(n), made)).collect();
    let kept = kept.into_iter().filter(|(path, _)| fs::exists(path).unwrap_or(false));
    let kept: Vec<(PathBuf, &Made)> = kept.take(SHOWN).collect();
    let captions: Vec<&str> = kept.iter().map(|(_, made)| made.caption.as_str()).collect();
    let mut truth = truth(folder, &captions);
    let read = |(path, made): (PathBuf, &Made)| {
        let features =
            read_motion(&path, made.fps).with_context(|| format!("reading {}", path.display()))?;
        Ok(Sample {
            caption: made.caption.clone(),
            run_id: run_id.to_string(),
            fps: made.fps,
            poses: recover_joints(&features),
            truth: truth.remove(&made.caption),
        })
    };
    kept.into_iter().map(read).collect()
}

/// The true motion of each caption, of the first clip of the test split that has it; none where the data are not
/// at hand.
fn truth(folder: &ResultsFolder, captions: &[&str]) -> HashMap<String, Vec<Pose>> {
    let Ok(sweep) = frozen_sweep(folder) else { return HashMap::new() };
    let Ok(data) = data::open(&sweep.data, demand(&sweep).as_ref()) else {
        return HashMap::new();
    };
    let mut found = HashMap::new();
    for clip in 0..data.n_clips(Split::Test) {
        let own = data.captions(Split::Test, clip);
        let Some(caption) = own.iter().find(|own| captions.contains(&own.as_str())) else {
            continue;
        };
        if let (false, Ok(features)) =
            (found.contains_key(caption), data.features(Split::Test, clip))
        {
            found.insert(caption.clone(), recover_joints(&features));
        }
    }
    found
}
