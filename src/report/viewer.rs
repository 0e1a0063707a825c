//! Generated motions beside true ones, as skeletons that play, turn and can be stopped.

use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

use super::input::{ReportInput, Sample, json_text, section};
use crate::motion::{N_JOINTS, PARENTS, Pose};

/// The viewer, and what it cannot show; `None` where there is no motion.
pub fn samples(input: &ReportInput) -> Option<Markup> {
    let viewer = viewer(input.samples);
    let within = html! {
        @if let Some((viewer, _)) = &viewer { (viewer) }
        @for sentence in input.not_shown { p { (sentence) } }
    };
    (viewer.is_some() || !input.not_shown.is_empty()).then(|| {
        html! {
            (section("samples", "Samples", &within))
            @if let Some((_, script)) = &viewer { (script) }
        }
    })
}

/// What is seen of the viewer, and the script that moves it, which follows.
fn viewer(samples: &[Sample]) -> Option<(Markup, Markup)> {
    let shown: Vec<Value> = samples.iter().map(shown).collect();
    let data = json!({ "parents": PARENTS, "samples": shown });
    let within = html! {
        p {
            "Motions that a run generated from captions of the test split"
            @if samples.iter().any(|sample| sample.truth.is_some()) {
                ", each next to the true motion of its caption"
                @if samples.iter().any(|sample| sample.reconstruction.is_some()) {
                    " and the tokenizer's reconstruction of it"
                }
            }
            ". Drag to turn them."
        }
        label for="sample" { "Caption " }
        select id="sample" {
            @for (place, sample) in samples.iter().enumerate() {
                option value=(place) { (sample.caption) }
            }
        }
        canvas id="stage" width="760" height="420" tabindex="0" role="img"
            aria-label="The skeletons of the chosen caption; arrow keys turn them" {}
        div.controls {
            button id="play" type="button" { "Pause" }
            label for="frame" { "Frame " }
            input id="frame" type="range" min="0" max="0" value="0" step="1";
        }
        p { "Run " code id="maker" {} span id="source" {} }
    };
    let script = html! {
        script id="motions" type="application/json" { (json_text(&data)) }
        script { (PreEscaped(include_str!("samples.js"))) }
    };
    (!samples.is_empty()).then_some((within, script))
}

/// The bodies of a caption in the order in which they stand.
fn shown(sample: &Sample) -> Value {
    let one = |name: &str, poses: &[Pose]| json!({ "name": name, "mm": packed(poses) });
    let several = sample.made.len() > 1;
    let made = sample.made.iter().enumerate().map(|(i, poses)| {
        let name = if several { format!("generated {}", i + 1) } else { "generated".to_string() };
        one(&name, poses)
    });
    let truth = sample.truth.as_ref().map(|truth| one("true motion", &truth.poses));
    let reconstruction =
        sample.reconstruction.as_ref().map(|poses| one("its reconstruction", poses));
    let bodies: Vec<Value> = truth.into_iter().chain(reconstruction).chain(made).collect();
    let source = sample.truth.as_ref().map(|truth| &truth.source);
    json!({ "run": sample.run_id, "fps": sample.fps, "source": source, "bodies": bodies })
}

/// Places in millimetres as text: frame after frame, each coordinate as the change from the frame before, in base64
/// VLQ, which source maps use. A change of at most 15 mm takes one character, of at most 511 mm two.
fn packed(poses: &[Pose]) -> String {
    let mut before = [0; 3 * N_JOINTS];
    let mut text = String::with_capacity(poses.len() * before.len() * 2);
    for pose in poses {
        for (metres, before) in pose.as_flattened().iter().zip(&mut before) {
            let now = (metres * 1000.0).round() as i32;
            push_vlq(&mut text, now - *before);
            *before = now;
        }
    }
    text
}

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Five bits a digit, the lowest first, of which the very first is the sign; 32 in a digit says that more follow.
fn push_vlq(text: &mut String, value: i32) {
    let mut left = (value.unsigned_abs() << 1) | u32::from(value < 0);
    loop {
        let more = left >> 5;
        let digit = (left & 31) | if more > 0 { 32 } else { 0 };
        text.push(char::from(DIGITS[digit as usize]));
        if more == 0 {
            return;
        }
        left = more;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_of_source_maps() {
        let known =
            [(0, "A"), (1, "C"), (-1, "D"), (15, "e"), (16, "gB"), (-511, "/f"), (123_456, "gkxH")];
        for (value, expected) in known {
            let mut text = String::new();
            push_vlq(&mut text, value);
            assert_eq!(text, expected, "{value}");
        }
    }

    #[test]
    fn a_body_that_stands_takes_a_character_a_coordinate() {
        let pose = [[0.0, 1.0, -0.001]; N_JOINTS];
        let text = packed(&[pose, pose]);
        assert_eq!(text, "Aw+BD".repeat(N_JOINTS) + &"AAA".repeat(N_JOINTS));
    }
}
