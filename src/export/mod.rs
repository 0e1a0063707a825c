//! Exports a sweep as a Jupyter notebook that reads the sweep's folder and draws its laws interactively.
//!
//! The cells are the files of `notebook/`, in the order of `CELLS`: plain markdown and Python. They compute only means
//! over seeds; everything else is read from the sweep.
//!
//! # Example
//!
//! ```
//! use isoflop::export::{NotebookInput, notebook};
//!
//! let input = NotebookInput { name: "first", results: "../results/first" };
//! assert_eq!(notebook(&input)["nbformat"], 4);
//! ```

use serde_json::{Value, json};

/// The input of a notebook.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotebookInput<'a> {
    /// The sweep's name.
    pub name: &'a str,
    /// The sweep's folder, seen from the notebook's: `../results/quickstart`.
    pub results: &'a str,
}

macro_rules! cells {
    ($($file:literal),* $(,)?) => {
        [$(($file, include_str!(concat!("notebook/", $file)))),*]
    };
}

/// The file name of each cell, unique and stable without its ending (as nbformat 4.5 requires of an id), and its
/// content.
const CELLS: [(&str, &str); 16] = cells![
    "title.md",
    "setup.py",
    "runs-text.md",
    "runs.py",
    "loss-flops-text.md",
    "loss-flops.py",
    "isoflop-text.md",
    "isoflop.py",
    "power-laws-text.md",
    "power-laws.py",
    "loss-law-text.md",
    "loss-law.py",
    "vocab-text.md",
    "vocab.py",
    "predict-text.md",
    "predict.py",
];

/// The notebook as a JSON document of nbformat 4.5, not yet executed.
///
/// It needs Python with polars and Altair (the first cell explains the installation), and `runs.parquet` and
/// `laws.json` in the sweep's folder; a null law is skipped. The same input gives the same document.
pub fn notebook(input: &NotebookInput) -> Value {
    let cells: Vec<Value> = CELLS.into_iter().map(|cell| document(cell, input)).collect();
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

/// The name and the folder of the sweep are filled in; in code both are quoted strings.
fn document((file, source): (&str, &str), input: &NotebookInput) -> Value {
    let markdown = file.strip_suffix(".md");
    // A JSON string is a Python string.
    let quoted = |text: &str| markdown.map_or_else(|| json!(text).to_string(), |_| text.to_owned());
    let source = source.trim_end().replace("SWEEP_NAME", &quoted(input.name));
    let source = source.replace("SWEEP_FOLDER", &quoted(input.results));
    // Lines that keep their ends, as notebooks store text.
    let lines: Vec<&str> = source.split_inclusive('\n').collect();
    match markdown {
        Some(id) => json!({
            "cell_type": "markdown", "id": id, "metadata": {}, "source": lines,
        }),
        None => json!({
            "cell_type": "code", "id": file.trim_end_matches(".py"), "metadata": {}, "source": lines,
            "execution_count": null, "outputs": [],
        }),
    }
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
        let cells = notebook["cells"].as_array().unwrap();
        let mut ids: Vec<_> = cells.iter().map(|c| c["id"].as_str().unwrap()).collect();
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
