//! A Jupyter notebook that reads a sweep's folder and draws its laws interactively.
//!
//! The cells are the files of `notebook/`, in the order of `CELLS`: markdown and Python that
//! can be read, and edited, as what they are. They compute nothing that the sweep has not
//! written, but for the means over seeds.

use serde_json::{Value, json};

/// What the notebook is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotebookInput<'a> {
    /// The sweep's name.
    pub name: &'a str,
    /// The sweep's folder, seen from the notebook's: `../results/quickstart`.
    pub results: &'a str,
}

enum Kind {
    Markdown,
    Code,
}

struct NotebookCell {
    /// Unique within the notebook and stable, as nbformat 4.5 asks.
    id: &'static str,
    kind: Kind,
    source: &'static str,
}

macro_rules! cell {
    ($id:literal, $kind:ident, $extension:literal) => {
        NotebookCell {
            id: $id,
            kind: Kind::$kind,
            source: include_str!(concat!("notebook/", $id, $extension)),
        }
    };
}

const CELLS: [NotebookCell; 16] = [
    cell!("title", Markdown, ".md"),
    cell!("setup", Code, ".py"),
    cell!("runs-text", Markdown, ".md"),
    cell!("runs", Code, ".py"),
    cell!("loss-flops-text", Markdown, ".md"),
    cell!("loss-flops", Code, ".py"),
    cell!("isoflop-text", Markdown, ".md"),
    cell!("isoflop", Code, ".py"),
    cell!("power-laws-text", Markdown, ".md"),
    cell!("power-laws", Code, ".py"),
    cell!("loss-law-text", Markdown, ".md"),
    cell!("loss-law", Code, ".py"),
    cell!("vocab-text", Markdown, ".md"),
    cell!("vocab", Code, ".py"),
    cell!("predict-text", Markdown, ".md"),
    cell!("predict", Code, ".py"),
];

/// The notebook as a JSON document of nbformat 4.5, not yet executed.
///
/// It needs Python with polars and Altair, which its first cell says how to install, and
/// `runs.parquet` and `laws.json` in the sweep's folder; a law that is null is passed over.
/// The same input gives the same document.
pub fn notebook(input: &NotebookInput) -> Value {
    let cells: Vec<Value> = CELLS.iter().map(|cell| cell.document(input)).collect();
    json!({
        "cells": cells,
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    })
}

impl NotebookCell {
    fn document(&self, input: &NotebookInput) -> Value {
        let filled = self.filled(input);
        let source = lines(&filled);
        match self.kind {
            Kind::Markdown => json!({
                "cell_type": "markdown", "id": self.id, "metadata": {}, "source": source,
            }),
            Kind::Code => json!({
                "cell_type": "code", "id": self.id, "metadata": {}, "source": source,
                "execution_count": null, "outputs": [],
            }),
        }
    }

    /// The source with the sweep's name and folder; in code both are quoted strings.
    fn filled(&self, input: &NotebookInput) -> String {
        let quoted = |text: &str| match self.kind {
            Kind::Markdown => text.to_owned(),
            // A JSON string is a Python string.
            Kind::Code => json!(text).to_string(),
        };
        let source = self.source.trim_end();
        source
            .replace("SWEEP_NAME", &quoted(input.name))
            .replace("SWEEP_FOLDER", &quoted(input.results))
    }
}

/// Lines that keep their ends, as notebooks store text.
fn lines(source: &str) -> Vec<&str> {
    source.split_inclusive('\n').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: NotebookInput =
        NotebookInput { name: "quickstart", results: "../results/quickstart" };

    fn sources(notebook: &Value) -> Vec<String> {
        let cells = notebook["cells"].as_array().expect("a list of cells");
        let lines = |cell: &Value| cell["source"].as_array().expect("a list of lines").clone();
        let text = |line: &Value| line.as_str().expect("a line of text").to_owned();
        cells.iter().map(|cell| lines(cell).iter().map(text).collect()).collect()
    }

    #[test]
    fn every_cell_has_what_nbformat_requires() {
        let notebook = notebook(&INPUT);
        assert_eq!((&notebook["nbformat"], &notebook["nbformat_minor"]), (&json!(4), &json!(5)));
        for cell in notebook["cells"].as_array().unwrap() {
            let code = match cell["cell_type"].as_str() {
                Some("code") => true,
                Some("markdown") => false,
                other => panic!("{other:?} is no type of cell"),
            };
            assert!(cell["metadata"].is_object());
            // Required in code cells, forbidden in the others.
            assert_eq!(cell.get("outputs").is_some(), code, "{}", cell["id"]);
            assert_eq!(cell.get("execution_count").is_some(), code, "{}", cell["id"]);
        }
    }

    #[test]
    fn ids_are_unique_and_of_allowed_characters() {
        let notebook = notebook(&INPUT);
        let mut ids: Vec<_> = notebook["cells"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c["id"].as_str().unwrap())
            .collect();
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        assert!(ids.iter().all(|id| (1..=64).contains(&id.len()) && id.chars().all(allowed)));
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
    }

    #[test]
    fn name_and_folder_are_filled_in_everywhere() {
        let sources = sources(&notebook(&INPUT));
        assert!(sources.iter().all(|source| !source.contains("SWEEP_")));
        assert!(sources[0].contains("quickstart"));
        assert!(sources.iter().any(|source| source.contains("Path(\"../results/quickstart\")")));
    }

    #[test]
    fn a_quote_in_a_folder_stays_inside_the_string() {
        let input = NotebookInput { results: "../it\"s \\ odd", ..INPUT };
        let sources = sources(&notebook(&input));
        assert!(sources.iter().any(|source| source.contains(r#"Path("../it\"s \\ odd")"#)));
    }

    #[test]
    fn the_same_sweep_gives_the_same_notebook() {
        assert_eq!(notebook(&INPUT).to_string(), notebook(&INPUT).to_string());
    }
}
