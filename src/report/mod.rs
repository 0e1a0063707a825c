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
//!     note: None,
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
mod viewer;

pub use figure::Figure;
pub use input::{ReportInput, Sample, Study, TrueMotion};

use maud::{DOCTYPE, Markup, PreEscaped, html};

use input::{extent, section};

/// The page, in HTML.
pub fn page(input: &ReportInput) -> String {
    let records = input.records();
    let studies = Some(html! { @for study in input.studies { (of_study(study)) } });
    let mut middle = [studies, viewer::samples(input)];
    // Without laws, motions are what there is to see.
    if input.studies.iter().all(|study| study.laws.is_none()) {
        middle.reverse();
    }
    let [first, second] = middle;
    let sections = [
        tables::generators(input.studies),
        first,
        second,
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
                header {
                    h1 { (input.name) }
                    p { (extent(&records)) }
                    @if let Some(note) = input.note { p.note { (note) } }
                }
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
            made: vec![vec![[[0.0; 3]; N_JOINTS]]],
            truth: Some(TrueMotion {
                poses: vec![[[0.0; 3]; N_JOINTS]],
                source: PLANTED.to_string(),
            }),
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
            note: Some(PLANTED),
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
            note: None,
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
