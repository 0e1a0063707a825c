//! Motions that were made, as skeletons that play, turn and can be stopped.

use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

use super::input::{self, Sample};
use crate::motion::{PARENTS, Pose};

/// The viewer; `None` where there is no motion.
pub fn section(samples: &[Sample]) -> Option<Markup> {
    let data =
        json!({ "parents": PARENTS, "samples": samples.iter().map(shown).collect::<Vec<_>>() });
    let within = html! {
        p {
            "Motions that a run made of captions of the test split"
            @if samples.iter().any(|sample| sample.truth.is_some()) {
                ", and beside each the true motion of its caption"
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
            aria-label="The skeleton of the chosen motion; arrow keys turn it" {}
        div.controls {
            button id="play" type="button" { "Pause" }
            label for="frame" { "Frame " }
            input id="frame" type="range" min="0" max="0" value="0" step="1";
        }
        p { "Run " code id="maker" {} }
    };
    (!samples.is_empty()).then(|| {
        html! {
            (input::section("samples", "Samples", &within))
            script id="motions" type="application/json" {
                (PreEscaped(data.to_string().replace('<', "\\u003c")))
            }
            script { (PreEscaped(include_str!("samples.js"))) }
        }
    })
}

/// Positions in millimetres, frame after frame.
fn shown(sample: &Sample) -> Value {
    let millimetres = |x: &f32| (x * 1000.0).round() as i32;
    let flat = |poses: &Vec<Pose>| -> Vec<i32> {
        poses.iter().flatten().flatten().map(millimetres).collect()
    };
    let truth = sample.truth.as_ref().map(flat);
    json!({ "run": sample.run_id, "fps": sample.fps, "mm": flat(&sample.poses), "truth": truth })
}
