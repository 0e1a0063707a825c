//! Motions of a sweep's folder for its page, each caption beside its true motion.

use crate::commands::prelude::*;
use isoflop::data::{self, Member, MotionSource, Split, read_motion};
use isoflop::figures::motion::not_drawn;
use isoflop::motion::{Pose, recover_joints};
use isoflop::plan::demand;
use isoflop::record::RunRecord;
use isoflop::report::{Sample, TrueMotion};
use std::collections::HashMap;

/// Motions on the page of a sweep.
#[derive(Args, Default, PartialEq)]
pub struct MotionArgs {
    /// Captions whose motions the page shows, at most; 6 by default
    #[arg(long, value_name = "N")]
    captions: Option<usize>,
    /// A data set of a union whose true motion the page does not show, e.g. for its licence; may be repeated
    #[arg(long, value_name = "NAME")]
    withhold: Vec<String>,
}

/// Captions that a page shows, by default.
const CAPTIONS: usize = 6;

/// Motions of a caption that a page shows, at most.
const OF_CAPTION: usize = 2;

/// The part of `motions.json` that is read.
#[derive(Deserialize)]
struct Made {
    caption: String,
    fps: f64,
}

/// Frames of a motion that a page shows, at most: it holds the place of every joint.
const MOST_FRAMES: usize = 2400;

/// Motions that a page shows, and a sentence on each that it cannot show.
type Samples = (Vec<Sample>, Vec<String>);

/// The motions of the first captions of the run of the lowest L_u that made some; none where no run did.
pub fn samples(
    folder: &ResultsFolder,
    records: &[RunRecord],
    args: &MotionArgs,
) -> Result<Samples> {
    let with_loss = |record| Some((record, RunRecord::loss_normalised(record).ok()?));
    let mut by_loss: Vec<(&RunRecord, f64)> = records.iter().filter_map(with_loss).collect();
    by_loss.sort_by(|a, b| a.1.total_cmp(&b.1));
    for (record, _) in by_loss {
        let run_id = &record.planned.run_id;
        let place = folder.file("samples").join(run_id);
        for place in [place.join("scored"), place] {
            if let Some(made) = read_if_there(&place.join("motions.json"))? {
                return of_run(folder, run_id, of_captions(&place, made, args), args);
            }
        }
    }
    Ok((Vec::new(), Vec::new()))
}

/// The motions of a caption: their files, and frames per second.
struct OfCaption {
    caption: String,
    fps: f64,
    files: Vec<PathBuf>,
}

/// The first captions of a folder that has their motions, each with its first motions.
fn of_captions(place: &Path, made: Vec<Made>, args: &MotionArgs) -> Vec<OfCaption> {
    let files = (0..).map(|n| place.join(format!("{n}.features.npy")));
    let mut all: Vec<OfCaption> = Vec::new();
    for (path, Made { caption, fps }) in files.zip(made).filter(|(path, _)| path.exists()) {
        match all.iter_mut().find(|own| own.caption == caption) {
            Some(own) => own.files.push(path),
            None => all.push(OfCaption { caption, fps, files: vec![path] }),
        }
    }
    all.truncate(args.captions.unwrap_or(CAPTIONS));
    all.iter_mut().for_each(|own| own.files.truncate(OF_CAPTION));
    all
}

fn of_run(
    home: &ResultsFolder,
    id: &str,
    made: Vec<OfCaption>,
    args: &MotionArgs,
) -> Result<Samples> {
    let captions: Vec<&str> = made.iter().map(|made| made.caption.as_str()).collect();
    let (mut samples, mut not_shown) = (Vec::new(), Vec::new());
    let mut truth = match truth(home, &captions, &args.withhold) {
        Ok((truth, withheld)) => {
            not_shown.extend(withheld);
            truth
        }
        Err(reason) => {
            not_shown.push(format!("No true motion is shown: {reason}."));
            HashMap::new()
        }
    };
    let mut reconstructed = reconstructions(home, id, &truth).unwrap_or_else(|error| {
        not_shown.push(format!("No reconstruction is shown: {error:#}."));
        HashMap::new()
    });
    for OfCaption { caption, fps, files } in made {
        let mut shown = |what: &str, features: &[f32]| {
            let poses = recover_joints(features);
            let reason = hindrance(&poses);
            not_shown.extend(
                reason
                    .iter()
                    .map(|reason| format!("{what} of \"{caption}\" is not shown: {reason}.")),
            );
            reason.is_none().then_some(poses)
        };
        let truth = truth.remove(&caption).and_then(|Truth { features, source }| {
            Some(TrueMotion { poses: shown("The true motion", &features)?, source })
        });
        let reconstruction = reconstructed.remove(&caption);
        let reconstruction = reconstruction.and_then(|own| shown("The reconstruction", &own));
        let mut made = Vec::new();
        for path in files {
            let features =
                read_motion(&path, fps).with_context(|| format!("reading {}", path.display()))?;
            made.extend(shown(&format!("The motion that run {id} made"), &features));
        }
        if !made.is_empty() {
            samples.push(Sample {
                caption,
                run_id: id.to_string(),
                fps,
                made,
                truth,
                reconstruction,
            });
        }
    }
    Ok((samples, not_shown))
}

/// Why a page does not show a motion; `None` if it can.
fn hindrance(poses: &[Pose]) -> Option<String> {
    let n = poses.len();
    let long = || (n > MOST_FRAMES).then(|| format!("it has {n} frames, more than {MOST_FRAMES}"));
    long().or_else(|| not_drawn(poses))
}

/// A clip of the test split.
struct Truth {
    /// `[T, 263]` row-major, not normalised.
    features: Vec<f32>,
    /// Its name, and the licence of its data set.
    source: String,
}

/// The true motion of each caption, from the first clip of the test split with it, and a sentence on each data set
/// that is withheld.
///
/// # Errors
/// A sentence: the sweep or its data cannot be read.
fn truth(
    folder: &ResultsFolder,
    captions: &[&str],
    withheld: &[String],
) -> Result<(HashMap<String, Truth>, Vec<String>), String> {
    let sweep = folder.sweep().map_err(|errors| errors.problems[0].message.clone())?;
    let data = data::open(&sweep.data, demand(&sweep).as_ref());
    let data = data.map_err(|error| error.to_string())?;
    let told = withheld.iter().map(|name| of_withheld(name, data.members()));
    let told = told.collect::<Result<_, String>>()?;
    let mut found = HashMap::new();
    for clip in 0..data.n_clips(Split::Test) {
        let (own, id) = (data.captions(Split::Test, clip), data.clip_id(Split::Test, clip));
        let member = member(&*data, &id);
        if member.is_none_or(|member| !withheld.contains(&member.name))
            && let Some(caption) = own.iter().find(|own| captions.contains(&own.as_str()))
            && !found.contains_key(caption)
            && let Ok(features) = data.features(Split::Test, clip)
        {
            let licence = member.and_then(|member| member.licence.as_deref());
            let licence = licence.map(|licence| format!(" ({licence})")).unwrap_or_default();
            found.insert(caption.clone(), Truth { features, source: id + &licence });
        }
    }
    Ok((found, told))
}

/// The data set of a union that has a clip, by the clip's name.
fn member<'a>(data: &'a dyn MotionSource, clip_id: &str) -> Option<&'a Member> {
    let rest = |member: &&Member| clip_id.strip_prefix(&member.name);
    data.members().iter().find(|member| rest(member).is_some_and(|rest| rest.starts_with('/')))
}

/// That the true motion of a data set is not shown.
///
/// # Errors
/// The union has no such data set.
fn of_withheld(name: &str, members: &[Member]) -> Result<String, String> {
    let Some(member) = members.iter().find(|member| member.name == name) else {
        let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
        let names = if names.is_empty() { "none".to_string() } else { names.join(", ") };
        return Err(format!("--withhold {name} names no data set of the sweep's union ({names})"));
    };
    let licence = member.licence.as_deref();
    let licence = licence.map(|licence| format!(" (its licence: {licence})")).unwrap_or_default();
    Ok(format!("True motion of {name} and its reconstruction are withheld{licence}."))
}

/// True motions from the codes that the run's tokenizer makes of them.
#[cfg(feature = "train")]
fn reconstructions(
    folder: &ResultsFolder,
    run_id: &str,
    truth: &HashMap<String, Truth>,
) -> Result<HashMap<String, Vec<f32>>> {
    use isoflop::jobs::{JobId, TrainedTokenizer};
    use isoflop::ops::DeviceName;
    if truth.is_empty() {
        return Ok(HashMap::new());
    }
    let run = folder.job(&JobId::run(run_id));
    let tokenizer = TrainedTokenizer::of_run(&run, &DeviceName::Flex.open()?)?;
    let one = |(caption, truth): (&String, &Truth)| {
        Ok((caption.clone(), tokenizer.reconstruction(&truth.features, caption)?))
    };
    truth.iter().map(one).collect()
}

/// This build has no tokenizers.
#[cfg(not(feature = "train"))]
fn reconstructions(
    _: &ResultsFolder,
    _: &str,
    _: &HashMap<String, Truth>,
) -> Result<HashMap<String, Vec<f32>>> {
    Ok(HashMap::new())
}
