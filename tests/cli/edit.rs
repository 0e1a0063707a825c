//! `isoflop generate --edit`: what it draws, and what stays where it was.

use std::ops::Range;

use isoflop::data::{read_motion, write_npy};
use isoflop::motion::{Pose, recover_joints};
use serde_json::Value;

use super::generate::{made, run_of_kind};
use super::support::Place;

/// Frames of the motions, of a code, and of half a second, over which a part goes over into the rest.
const N: usize = 120;
const CODE: usize = 4;
const FADE: usize = 10;

/// A place with a motion to edit, `source.npy`, and the run's own reconstruction of it.
struct Edits<'a> {
    place: &'a Place,
    run: &'a str,
    source: Vec<Pose>,
    reconstruction: Vec<Pose>,
    codes: Vec<Value>,
    /// Distance in millimetres that a joint in the part moves by, at least.
    least_mm: f32,
}

fn poses(place: &Place, file: &str) -> Vec<Pose> {
    recover_joints(&read_motion(&place.path(file), 20.0).expect("a motion"))
}

/// The largest distance of a joint between two motions, each at its own place, in millimetres.
fn apart_mm(a: &[Pose], b: &[Pose], frames: impl Fn(usize) -> bool) -> f32 {
    assert_eq!((a.len(), b.len()), (N, N));
    let pairs = (0..N).filter(|t| frames(*t)).flat_map(|t| a[t].iter().zip(&b[t]));
    let distance = |(a, b): (&[f32; 3], &[f32; 3])| {
        (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt() * 1000.0
    };
    pairs.map(distance).fold(0.0, f32::max)
}

impl<'a> Edits<'a> {
    fn new(place: &'a Place, run: &'a str) -> Self {
        let file = "whole/0.features.npy";
        let frames = N.to_string();
        made(place, run, &["--out", "whole", "--frames", &frames, "--overwrite"]);
        let words = ["tokenize", file, "--run", run, "--out", "codes", "--overwrite"];
        place.isoflop(&words).exits(0);
        let codes = place.json("codes/0.json")["codes"].as_array().expect("codes").clone();
        let words = ["detokenize", "codes/0.json", "--run", run, "--out", "back", "--overwrite"];
        place.isoflop(&words).exits(0);
        let reconstruction = poses(place, "back/0.features.npy");
        Self { place, run, source: poses(place, file), reconstruction, codes, least_mm: 1.0 }
    }

    /// Motions of two captions with a part drawn at a temperature at which any code is about as likely as any other.
    fn made(&self, span: &str, more: &[&str]) -> Vec<(Vec<Value>, Vec<Pose>)> {
        let words = ["--edit", "whole/0.features.npy", "--anew", span, "--temperature", "50"];
        let words = [&words[..], &["--out", "edited", "--overwrite"], more].concat();
        let motions = made(self.place, self.run, &words);
        let codes = |motion: &Value| motion["codes"].as_array().expect("codes").clone();
        let motions = motions.iter().enumerate();
        let pose = |n| poses(self.place, &format!("edited/{n}.features.npy"));
        motions.map(|(n, motion)| (codes(motion), pose(n))).collect()
    }

    /// Holds an edit to its promise: frames more than half a second away from the part are those of the reconstruction,
    /// or with `--paste` the motion's own, and the part is another. Returns the codes that were drawn anew, in either
    /// motion.
    fn hold(&self, span: &str, part: Range<usize>) -> Vec<usize> {
        let outside = |t: usize| t + FADE < part.start || t >= part.end + FADE;
        let mut drawn = Vec::new();
        for (more, rest) in [(&[][..], &self.reconstruction), (&["--paste"], &self.source)] {
            for (codes, poses) in self.made(span, more) {
                let off = apart_mm(&poses, rest, outside);
                assert!(off < 0.01, "{} {span} {more:?}: {off} mm", self.run);
                let moved = apart_mm(&poses, rest, |t| part.contains(&t));
                assert!(moved > self.least_mm, "{} {span} {more:?}: {moved} mm", self.run);
                let changed = (0..codes.len()).filter(|&i| codes[i] != self.codes[i]);
                drawn.extend(changed);
            }
        }
        drawn.sort_unstable();
        drawn.dedup();
        drawn
    }
}

#[test]
fn an_edit_moves_no_frame_half_a_second_away_of_one_codebook() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml", "--set", "generator=[autoregressive, masked]"]).exits(0);
    for kind in ["autoregressive", "masked"] {
        let run = run_of_kind(&place.path("results/mini"), kind);
        let edits = Edits::new(&place, &run);
        for (span, frames) in [("2..3", 40..60), ("..2", 0..40), ("4..", 80..N)] {
            let drawn = edits.hold(span, frames.clone());
            let inside = |&i: &usize| frames.contains(&(i * CODE));
            assert!(!drawn.is_empty() && drawn.iter().all(inside), "{span}: {drawn:?}");
        }
    }
    what_cannot_be_edited_is_told(&place);
}

fn what_cannot_be_edited_is_told(place: &Place) {
    let (run, file) = ("results/mini", "whole/0.features.npy");
    let longer = ["--edit", file, "--anew", "5.5..", "--seconds", "7", "--out", "longer"];
    assert!(made(place, run, &longer).iter().all(|motion| motion["length"] == 140));
    let refused = |words: &[&str], sentence: &str| {
        let all = [&["generate", "walk", "--run", run, "--out", "no"], words].concat();
        place.isoflop(&all).exits(2).says(sentence);
    };
    refused(&["--edit", file], "--anew");
    refused(&["--paste"], "--edit");
    refused(&["--edit", file, "--anew", "2..1"], "no span of seconds");
    refused(&["--edit", file, "--anew", "9.."], "which is 6.00 s long");
    refused(&["--edit", file, "--anew", "..1", "--frames", "20"], "ask for no fewer");
    refused(&["--edit", "mini.yaml", "--anew", "..1"], "no motion that can be read");
    let lying: Vec<Pose> =
        poses(place, file).iter().map(|pose| pose.map(|[x, y, z]| [x, -z, y])).collect();
    write_npy(&place.path("lying.npy"), &[N, 22, 3], lying.as_flattened().as_flattened())
        .expect("a writable folder");
    let edit = ["--edit", "lying.npy", "--anew", "2..3", "--out", "lain"];
    let ended = place.isoflop(&[&["generate", "walk", "--run", run], &edit[..]].concat());
    ended.exits(0).says("lying.npy: the body lies ");
}

#[test]
fn an_edit_moves_no_frame_half_a_second_away_of_several_layers() {
    let place = Place::with("residual.yaml");
    let one = ["--set", "generator=masked", "--set", "seeds=[0]", "--set", "grid.vocab=[16]"];
    place.isoflop(&[&["run", "residual.yaml"][..], &one].concat()).exits(0);
    let drawn = Edits::new(&place, "results/residual").hold("2..3", 40..60);
    let inside = |i: &usize| (10..15).contains(&(i % (N / CODE)));
    assert!(drawn.iter().all(inside) && drawn.iter().any(|i| *i > 60), "{drawn:?}");
}

/// Scales of 1, 8 and 20 codes for 25 latents of 4.8 frames, of which the part has 8 to 16: the codes of eight that add
/// to these alone are 3 and 4, those of twenty 7 to 12.
#[test]
fn an_edit_moves_no_frame_half_a_second_away_of_a_fixed_number_of_latents() {
    let place = Place::with("generators.yaml");
    let tokenizer = "tokenizer={kind: transformer, width: 8, layers: 1, heads: 2, latent: 8, latents: 25, \
                     window: 120, steps: 12, batch: 2, pool_clips: 8, \
                     quantizer: {kind: multiscale, scales: [1, 8, 20]}}";
    let one = ["--set", tokenizer, "--set", "generator=scalewise", "--set", "grid.vocab=[16]"];
    place.isoflop(&[&["run", "generators.yaml"][..], &one].concat()).exits(0);
    let mut edits = Edits::new(&place, "results/generators");
    // After so few steps this tokenizer hardly reads its codes; frames outside move by less than half of it.
    edits.least_mm = 0.02;
    assert_eq!(edits.codes.len(), 29);
    let drawn = edits.hold("2..4", 40..80);
    let inside = |i: &usize| (1 + 3..1 + 5).contains(i) || (9 + 7..9 + 13).contains(i);
    assert!(!drawn.is_empty() && drawn.iter().all(inside), "{drawn:?}");
}

/// Scales of 1, 8 and 20 codes for 30 latents, of which the part has 10 to 19. A code of eight adds to 7 or 8 latents,
/// and none of them to latents of the part alone; of twenty codes 7 to 12 do.
#[test]
fn an_edit_moves_no_frame_half_a_second_away_of_several_scales() {
    let place = Place::with("generators.yaml");
    let scales = ["--set", "tokenizer.quantizer.scales=[1, 8, 20]", "--set", "grid.vocab=[16]"];
    place.isoflop(&[&["run", "generators.yaml"][..], &scales].concat()).exits(0);
    for kind in ["autoregressive", "scalewise"] {
        let run = run_of_kind(&place.path("results/generators"), kind);
        let drawn = Edits::new(&place, &run).hold("2..4", 40..80);
        let inside = |i: &usize| (9 + 7..9 + 13).contains(i);
        assert!(!drawn.is_empty() && drawn.iter().all(inside), "{kind}: {drawn:?}");
    }
}
