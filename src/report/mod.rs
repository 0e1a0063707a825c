//! A sweep's results as one HTML page that needs no network: `report.html`.
//!
//! [`ReportInput`] holds the contents; one function per section makes its markup. The script only moves, sorts
//! and filters: every number is written here.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use isoflop::record::table;
//! use isoflop::report::{ReportInput, Study, page};
//!
//! let records = table::read(Path::new("results/cmu-motion"))?;
//! let study = Study {
//!     generator: None,
//!     loss_name: None,
//!     verdict: "No laws yet.",
//!     laws: None,
//!     predictions: &[],
//!     records: &records,
//!     figures: &[],
//! };
//! let html = page(&ReportInput {
//!     name: "cmu-motion",
//!     studies: &[study],
//!     samples: &[],
//!     not_shown: &[],
//!     tokenizers: &[],
//!     figures: &[],
//!     sweep: "name: cmu-motion",
//!     dropped: &[],
//! });
//! assert!(html.starts_with("<!DOCTYPE html>") && !html.contains("src=\"http"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod curves;
mod figure;
mod input;
mod laws;
mod tables;

pub use figure::Figure;
pub use input::{ReportInput, Sample, Study};

use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Value, json};

use crate::motion::{PARENTS, Pose};
use input::{extent, json_text, section};

/// The page, in HTML.
pub fn page(input: &ReportInput) -> String {
    let records = input.records();
    let sections = [
        tables::generators(input.studies),
        Some(html! { @for study in input.studies { (of_study(study)) } }),
        samples(input),
        input.studies.first().and_then(|study| tables::runs(&records, &study.words())),
        tables::tokenizers(input.tokenizers),
        Some(figures(input)),
        Some(tables::provenance(input)),
    ];
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (input.name) " · isoflop" }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header { h1 { (input.name) } p { (extent(&records)) } }
                main { @for section in sections.into_iter().flatten() { (section) } }
                script { (PreEscaped(include_str!("script.js"))) }
            }
        }
    };
    page.into_string()
}

/// The results of one generator.
fn of_study(study: &Study) -> Markup {
    let sections = [
        Some(verdict(study)),
        laws::prediction(study),
        curves::isoflop(study),
        study.laws.map(|laws| laws::section(study, laws)),
    ];
    html! { div.study { @for section in sections.into_iter().flatten() { (section) } } }
}

fn verdict(study: &Study) -> Markup {
    let within = html! {
        pre tabindex="0" role="region" aria-label=(study.own("The verdict in full")) { (study.verdict.trim()) }
    };
    study.section("verdict", "Verdict", &within)
}

/// The figures of all generators together, then of each.
fn figures(input: &ReportInput) -> Markup {
    html! {
        @if !input.figures.is_empty() { (section("all-figures", "Figures", &drawn(input.figures))) }
        @for study in input.studies.iter().filter(|study| !study.figures.is_empty()) {
            (study.section("figures", "Figures", &drawn(study.figures)))
        }
    }
}

fn drawn(figures: &[Figure]) -> Markup {
    html! {
        @for (name, figure) in figures.iter().map(|figure| (figure.name.replace('_', " "), figure)) {
            figure {
                div.paper role="img" aria-label=(name) { (PreEscaped(figure.svg())) }
                figcaption { (name) }
            }
        }
    }
}

// Generated motions, as skeletons that play, turn and can be stopped.

/// The viewer, and what it cannot show; `None` where there is no motion.
fn samples(input: &ReportInput) -> Option<Markup> {
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
            aria-label="The skeleton of the chosen motion; arrow keys turn it" {}
        div.controls {
            button id="play" type="button" { "Pause" }
            label for="frame" { "Frame " }
            input id="frame" type="range" min="0" max="0" value="0" step="1";
        }
        p { "Run " code id="maker" {} }
    };
    let script = html! {
        script id="motions" type="application/json" { (json_text(&data)) }
        script { (PreEscaped(include_str!("samples.js"))) }
    };
    (!samples.is_empty()).then_some((within, script))
}

/// Positions in millimetres, frame after frame.
fn shown(sample: &Sample) -> Value {
    let flat = |poses: &Vec<Pose>| -> Vec<i32> {
        poses.iter().flatten().flatten().map(|x| (x * 1000.0).round() as i32).collect()
    };
    let bodies = [
        ("true motion", sample.truth.as_ref()),
        ("its reconstruction", sample.reconstruction.as_ref()),
        ("generated", Some(&sample.poses)),
    ];
    let body = |(name, poses): (&str, Option<&Vec<Pose>>)| {
        Some(json!({ "name": name, "mm": flat(poses?) }))
    };
    let bodies: Vec<Value> = bodies.into_iter().filter_map(body).collect();
    json!({ "run": sample.run_id, "fps": sample.fps, "bodies": bodies })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    /// Ends a script, then asks for a picture that is not there.
    const PLANTED: &str = "</script></title><img src=x onerror=alert(1)>\"'";

    #[test]
    fn words_of_others_stay_words_wherever_they_stand() {
        let sample = Sample {
            caption: PLANTED.to_string(),
            run_id: PLANTED.to_string(),
            fps: 20.0,
            poses: vec![[[0.0; 3]; N_JOINTS]],
            truth: None,
            reconstruction: None,
        };
        let study = Study {
            generator: Some(PLANTED),
            loss_name: Some(PLANTED),
            verdict: PLANTED,
            laws: None,
            predictions: &[],
            records: &[],
            figures: &[Figure::read(PLANTED, "<svg></svg>").unwrap()],
        };
        let told = [PLANTED.to_string()];
        let page = page(&ReportInput {
            name: PLANTED,
            studies: &[study],
            samples: &[sample],
            not_shown: &told,
            tokenizers: &[],
            figures: &[],
            sweep: PLANTED,
            dropped: &told,
        });
        assert!(!page.contains("<img"), "{page}");
        // That of the page, the viewer's and its motions.
        assert_eq!(page.matches("</script>").count(), 3);
        assert!(page.matches("onerror=alert(1)&gt;").count() >= 8, "they are there as words");
    }

    #[test]
    fn motions_that_cannot_be_shown_are_told_without_a_viewer() {
        let input = ReportInput {
            name: "far",
            studies: &[],
            samples: &[],
            not_shown: &["a joint lies 1e38 m away".to_string()],
            tokenizers: &[],
            figures: &[],
            sweep: "",
            dropped: &[],
        };
        let shown = page(&input);
        assert!(shown.contains("<p>a joint lies 1e38 m away</p>") && !shown.contains("<canvas"));
        assert!(!page(&ReportInput { not_shown: &[], ..input }).contains("Samples"));
    }
}
