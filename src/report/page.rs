//! [`page`]: the page as a whole.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::input::{Figure, ReportInput};
use super::{about, curves, laws, prediction, runs, samples, scaling, tokenizers};

/// The page, in HTML.
pub fn page(input: &ReportInput) -> String {
    let sections = [
        Some(verdict(input)),
        prediction::section(input),
        curves::section(input),
        input.laws.map(laws::section),
        samples::section(input.samples),
        runs::section(input.records),
        tokenizers::section(input.tokenizers),
        figures(input.figures),
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
                header { h1 { (input.name) } p { (scaling::extent(input.records)) } }
                main { @for section in sections.into_iter().flatten() { (section) } }
                script { (PreEscaped(include_str!("script.js"))) }
            }
        }
    };
    page.into_string()
}

fn verdict(input: &ReportInput) -> Markup {
    html! {
        section aria-labelledby="verdict" {
            h2 id="verdict" { "Verdict" }
            pre tabindex="0" role="region" aria-label="The verdict in full" { (input.verdict.trim()) }
        }
    }
}

fn figures(figures: &[Figure]) -> Option<Markup> {
    (!figures.is_empty()).then(|| {
        html! {
            section aria-labelledby="figures" {
                h2 id="figures" { "Figures" }
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
    })
}

/// An SVG file without what stands before its root.
fn drawing(svg: &str) -> &str {
    svg.find("<svg").map_or("", |start| &svg[start..])
}
