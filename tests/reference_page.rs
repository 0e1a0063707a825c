//! `docs/sweep-file.md` is what the source says of sweep files.

use std::path::Path;

use isoflop::sweep::{reference, schema};

const BLESS: &str = "ISOFLOP_BLESS=1 cargo test --release --test reference_page";

#[test]
fn the_page_about_sweep_files_is_what_the_source_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/sweep-file.md");
    let page = reference();
    if std::env::var_os("ISOFLOP_BLESS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let mut lines = page.lines().zip(written.lines()).enumerate();
    let differs = lines.find(|(_, (page, written))| page != written);
    if let Some((line, (page, written))) = differs {
        let line = line + 1;
        panic!("docs/sweep-file.md:{line}:\n- {written}\n+ {page}\nwrite it again: {BLESS}");
    }
    assert!(page == written, "docs/sweep-file.md ends elsewhere; write it again: {BLESS}");
}

#[test]
fn the_schema_of_sweep_files_is_what_the_source_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/sweep.schema.json");
    let made = serde_json::to_string_pretty(&schema()).unwrap() + "\n";
    if std::env::var_os("ISOFLOP_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(made == written, "docs/sweep.schema.json is not what the source says: {BLESS}");
}

/// Editors check a file by the line at its head.
#[test]
fn every_example_names_the_schema() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments");
    let line = "# yaml-language-server: $schema=../docs/sweep.schema.json";
    for entry in std::fs::read_dir(root).unwrap().flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".yaml") && !name.ends_with("-profile.yaml") {
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.lines().next() == Some(line), "{}: begin with {line}", path.display());
        }
    }
}

#[test]
fn every_key_and_every_word_has_a_meaning() {
    let page = reference();
    let bare =
        |line: &&str| line.ends_with("|  |") || line.starts_with("- ") && line.ends_with(": ");
    let bare: Vec<&str> = page.lines().filter(bare).collect();
    assert!(bare.is_empty(), "say what these are, above their fields:\n{}", bare.join("\n"));
}

#[test]
fn every_section_of_the_file_is_on_the_page() {
    let page = reference();
    for heading in ["## `grid`", "### `grid.models[]`", "### `train.lr`", "### `engine.slurm`"] {
        assert!(page.lines().any(|line| line == heading), "{heading}");
    }
    let sweep = page.split("```yaml\n").nth(1).unwrap().split("```").next().unwrap();
    isoflop::sweep::parse("example", sweep, &[]).expect("the example of the page is a sweep");
}
