//! [`page`]: the page as a whole.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::input::{Figure, ReportInput, Study, section};
use super::{about, beside, curves, laws, prediction, runs, samples, scaling, tokenizers};

/// The page, in HTML.
pub fn page(input: &ReportInput) -> String {
    let records = input.records();
    let sections = [
        beside::section(input.studies),
        Some(html! { @for study in input.studies { (of_study(study)) } }),
        samples::section(input.samples),
        input.studies.first().and_then(|study| runs::section(&records, &study.words())),
        tokenizers::section(input.tokenizers),
        Some(figures(input)),
        Some(about::section(input)),
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
                header { h1 { (input.name) } p { (scaling::extent(&records)) } }
                main { @for section in sections.into_iter().flatten() { (section) } }
                script { (PreEscaped(include_str!("script.js"))) }
            }
        }
    };
    page.into_string()
}

/// What the runs of one generator say.
fn of_study(study: &Study) -> Markup {
    let sections = [
        Some(verdict(study)),
        prediction::section(study),
        curves::section(study),
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

/// The figures of all generators together, then those of each.
fn figures(input: &ReportInput) -> Markup {
    let has_any = |study: &&Study| !study.figures.is_empty();
    html! {
        @if !input.figures.is_empty() { (section("all-figures", "Figures", &drawn(input.figures))) }
        @for study in input.studies.iter().filter(has_any) {
            (study.section("figures", "Figures", &drawn(study.figures)))
        }
    }
}

fn drawn(figures: &[Figure]) -> Markup {
    html! {
        @for Figure { name, svg } in figures {
            figure {
                div.paper role="img" aria-label=(name.replace('_', " ")) {
                    (PreEscaped(drawing(svg)))
                }
                figcaption { (name.replace('_', " ")) }
            }
        }
    }
}

/// An SVG file without what stands before its root.
fn drawing(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}
