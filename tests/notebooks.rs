//! Every notebook runs from its first cell to its last, offline, where Jupyter and what the notebooks import
//! are installed.

use std::path::Path;
use std::process::Command;

/// Runs the notebook that is its argument, in the folder that it lies in.
const RUN: &str = "
import sys, nbformat, nbclient
path = sys.argv[1]
notebook = nbformat.read(path, as_version=4)
nbclient.NotebookClient(notebook, timeout=300, kernel_name='python3').execute(cwd='.')
print(path, sum(len(cell.get('outputs', ())) for cell in notebook.cells), 'outputs')
";

fn python(root: &Path, words: &[&str]) -> Option<std::process::Output> {
    let path = root.join("python");
    let folder = root.join("notebooks-export");
    let mut python = Command::new("python3");
    python.args(words).current_dir(folder).env("PYTHONPATH", path);
    python
        .env("ISOFLOP_PROGRAM", env!("CARGO_BIN_EXE_isoflop"))
        .env("PYTHONDONTWRITEBYTECODE", "1");
    python.output().ok()
}

#[test]
fn every_notebook_runs_to_its_end() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let needed = "import altair, ipykernel, nbclient, nbformat, polars";
    if !python(root, &["-c", needed]).is_some_and(|ended| ended.status.success()) {
        eprintln!("skipped: python3 has not all of: {needed}");
        return;
    }
    let names = std::fs::read_dir(root.join("notebooks-export")).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut notebooks: Vec<String> = names.filter(|name| name.ends_with(".ipynb")).collect();
    notebooks.sort();
    assert!(notebooks.len() >= 3, "{notebooks:?}");
    for notebook in notebooks {
        let ended = python(root, &["-c", RUN, &notebook]).unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.success(), "{notebook}: {said}");
    }
}

#[test]
fn the_notebooks_of_studies_are_those_that_the_program_exports() {
    for name in ["cmu-motion", "procedural-law"] {
        let path = format!("{}/notebooks-export/{name}.ipynb", env!("CARGO_MANIFEST_DIR"));
        let kept: serde_json::Value =
            serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let results = format!("../results/{name}");
        let own =
            isoflop::export::notebook(&isoflop::export::NotebookInput { name, results: &results });
        assert_eq!(kept, own, "`isoflop export results/{name} --to notebook` makes another");
    }
}
