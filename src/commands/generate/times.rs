//! `isoflop generate --times`: measures the time per motion, by batch size, with and without guidance.

use super::args::GenerateArgs;
use crate::commands::prelude::*;
use isoflop::generator::{Prompt, Sampling};
use isoflop::jobs::TrainedRun;
use std::time::Instant;

/// Batch sizes.
const BATCHES: [usize; 4] = [1, 4, 16, 64];

/// Least rounds and seconds of each measurement; the first round does not count.
const LEAST_ROUNDS: usize = 5;
const LEAST_S: f64 = 0.5;

/// Measurements that take longer than this have fewer rounds.
const LONG_S: f64 = 20.0;
const ROUNDS_OF_LONG: usize = 3;

/// Batches that would take longer than this per round are left out.
const LONGEST_S: f64 = 60.0;

/// Defaults from LG-Tok's table: guidance 4, and the seconds of a whole clip.
const GUIDANCE: f64 = 4.0;
const SECONDS: f64 = 9.8;

/// The default caption.
const CAPTION: &str = "a person walks forward and turns around";

/// The time of a batch of motions, decoding included.
#[derive(Serialize)]
struct Timed {
    batch: usize,
    guidance: f64,
    /// Seconds per motion: the median of the rounds, the shortest and the longest.
    seconds: f64,
    least: f64,
    most: f64,
    rounds: usize,
}

/// Measures a run's generator and tokenizer on the device at hand.
pub fn times(args: &GenerateArgs, run: &TrainedRun, output: &Output) -> Result<Exit> {
    let caption = args.captions.first().map_or(CAPTION, String::as_str);
    let vectors = run.embed(caption)?;
    let fps = run.spec.fps;
    let n_frames = args.n_frames(fps).unwrap_or((SECONDS * fps).round() as usize);
    let asked = args.guidance.filter(|guidance| *guidance > 0.0).unwrap_or(GUIDANCE);
    let guidances = if run.takes_guidance() { vec![0.0, asked] } else { vec![0.0] };
    let (sampling, _) = args.sampling(run)?;
    let mut all = Vec::new();
    for &guidance in &guidances {
        let sampling = Sampling { guidance, ..sampling };
        let mut before_s = 0.0;
        for batch in BATCHES {
            if before_s * batch as f64 > LONGEST_S {
                break;
            }
            let timed = timed(run, (&vectors, n_frames), batch, &sampling)?;
            before_s = timed.seconds;
            all.push(timed);
        }
    }
    let seconds = n_frames as f64 / fps;
    let document = json!({
        "run": run.run_id, "device": args.device.name(), "seconds_of_motion": seconds, "times": all,
    });
    output.result(&document, &text(args, run, seconds, &all))
}

fn timed(
    run: &TrainedRun,
    (text, n_frames): (&[f32], usize),
    batch: usize,
    sampling: &Sampling,
) -> Result<Timed> {
    let mut rounds: Vec<f64> = Vec::new();
    let began = Instant::now();
    for round in 0.. {
        let prompt = |index: usize| {
            let (index, seed) = (index as u64, round);
            Prompt { text, n_frames: Some(n_frames), seed, index, edit: None }
        };
        let prompts: Vec<Prompt> = (0..batch).map(prompt).collect();
        let started = Instant::now();
        run.motions(&prompts, sampling, 0.0)?;
        let seconds = started.elapsed().as_secs_f64() / batch as f64;
        if round > 0 {
            rounds.push(seconds);
        }
        let elapsed = began.elapsed().as_secs_f64();
        let (least_rounds, least_s) =
            if elapsed > LONG_S { (ROUNDS_OF_LONG, 0.0) } else { (LEAST_ROUNDS, LEAST_S) };
        if rounds.len() >= least_rounds && elapsed > least_s {
            break;
        }
    }
    rounds.sort_by(f64::total_cmp);
    Ok(Timed {
        batch,
        guidance: sampling.guidance,
        seconds: rounds[rounds.len() / 2],
        least: rounds[0],
        most: rounds[rounds.len() - 1],
        rounds: rounds.len(),
    })
}

/// One line per batch and guidance.
fn text(args: &GenerateArgs, run: &TrainedRun, seconds: f64, times: &[Timed]) -> String {
    let row = |timed: &Timed| {
        let Timed { batch, guidance, seconds, least, most, .. } = timed;
        let [own, a_minute] = [format!("{seconds:.5}"), format!("{:.0}", 60.0 / seconds)];
        let range = format!("{least:.5} to {most:.5}");
        [batch.to_string(), guidance.to_string(), own, range, a_minute]
    };
    let heads = ["batch", "guidance", "<s a motion", "<least to most", "<motions a minute"];
    format!(
        "{}, {} ({})\nmotions of {seconds:.1} s on {}\n\n{}\
         the median of five rounds and more; decoding is part of it, files are not",
        run.spec.generator.name(),
        run.spec.label(),
        run.run_id,
        args.device.name(),
        table(heads, times.iter().map(row))
    )
}
