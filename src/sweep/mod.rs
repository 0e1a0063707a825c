//! Sweep files: YAML into a checked [`Sweep`].
//!
//! # Example
//!
//! ```
//! use isoflop::sweep;
//!
//! let text = "name: first\ngrid: {models: scamo, vocab: [256], budgets: [1e18]}\n";
//! let sweep = sweep::parse("first.yaml", text, &["seeds=[0, 1]".to_string()])?;
//! assert_eq!((sweep.grid.budgets, sweep.seeds), (vec![1e18], vec![0, 1]));
//!
//! let slip = sweep::parse("first.yaml", &text.replace("vocab", "vocabs"), &[]).unwrap_err();
//! assert!(slip.to_string().contains("first.yaml:2:23") && slip.to_string().contains("`vocab`"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cells;
mod check;
mod overrides;
pub mod presets;
mod problem;
mod reference;
mod sections;
mod typed;
mod variants;
mod yaml;

pub use cells::{Condition, models, shape};
pub use problem::{Problem, Source, SweepErrors};
pub use reference::{reference, schema};
pub use sections::*;
pub use variants::Variant;

use std::path::Path;

use serde_yaml::{Mapping, Value};

use crate::files::{FileError, read_yaml_if_there};
use crate::spec::ScoresSpec;
use check::{check, engine};
use presets::Layers;
use problem::nearest;
use typed::{RemovedEntries, typed};

/// Reads a sweep file, or a preset if no file has that name, and applies `path=value` settings.
pub fn read(path: &Path, settings: &[String]) -> Result<Sweep, SweepErrors> {
    if let Some(preset) = presets::at(path) {
        let named = Mapping::from_iter([("preset".into(), preset.name.into())]);
        return gather(named, Source::new(preset.title(), ""), settings);
    }
    let source = yaml::source(path).map_err(|errors| SweepErrors {
        problems: errors.problems.into_iter().map(|problem| or_a_preset(problem, path)).collect(),
        ..errors
    })?;
    parse(&source.name, &source.text, settings)
}

/// Reads the resolved sweep in a results folder.
///
/// # Errors
/// Also where its digest is that of another text.
pub fn read_resolved(path: &Path) -> Result<Sweep, SweepErrors> {
    let damaged = |error: FileError| {
        let source = Source::new(path.display().to_string(), "");
        SweepErrors::of(Problem::value("", error.to_string()), source)
    };
    read_yaml_if_there(path).map_err(damaged)?;
    read(path, &[])
}

/// If the file is missing, suggests the closest preset name.
fn or_a_preset(problem: Problem, path: &Path) -> Problem {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let help = format!("no preset has that name either; {}", nearest(&name, &presets::NAMES));
    if path.exists() { problem } else { problem.with_help(help) }
}

/// Reads a profile: a file with keys of `engine.slurm`, which override those of sweeps.
pub fn read_profile(path: &Path) -> Result<SlurmSection, SweepErrors> {
    let source = yaml::source(path)?;
    gather_profile(&source.text).map_err(|problems| SweepErrors { sources: vec![source], problems })
}

/// [`read`] for a text at hand; `file` is its name in messages.
pub fn parse(file: &str, text: &str, settings: &[String]) -> Result<Sweep, SweepErrors> {
    let source = Source::new(file, text);
    match yaml::mapping(text, yaml::SWEEP_FILE) {
        Ok(keys) => gather(keys, source, settings),
        Err(problem) => Err(SweepErrors::of(problem, source)),
    }
}

/// A sweep from keys, over the file that they include or the preset that they name.
///
/// Settings of a section's kind are applied to the keys first, so that a preset's section of another kind is removed;
/// then all settings are applied to both.
fn gather(keys: Mapping, source: Source, settings: &[String]) -> Result<Sweep, SweepErrors> {
    let mut own = Value::Mapping(keys);
    overrides::apply(&mut own, &overrides::of_kinds(settings));
    let Value::Mapping(own) = own else { unreachable!("a setting names a key") };
    let Layers { keys, sources } = Layers::of(own, source, &[]).map_err(|mut errors| {
        errors.problems.iter_mut().for_each(|problem| overrides::blame(problem, settings));
        errors
    })?;
    check_all(Value::Mapping(keys), settings).map_err(|problems| SweepErrors { sources, problems })
}

fn check_all(mut value: Value, settings: &[String]) -> Result<Sweep, Vec<Problem>> {
    let mut problems = overrides::apply(&mut value, settings);
    let mut removed = RemovedEntries::default();
    let outside = typed::outside_of_sweep(&value);
    // From behind, so that no item of a list moves before it is taken out.
    for Problem { path, .. } in outside.iter().rev() {
        variants::remove(&mut value, path);
        removed.note(path.clone());
    }
    let given = value.get("scores").cloned().unwrap_or_default();
    let sweep: Option<Sweep> = typed(value, &mut removed, &mut problems);
    let sweep = sweep.map(|sweep| {
        let sampled =
            |own: ScoresSpec| own.sampled_by(&sweep.sampling, |key| given.get(key).is_some());
        Sweep { scores: sweep.scores.clone().map(sampled), ..sweep }
    });
    if let Some(sweep) = &sweep {
        problems.extend(check(sweep).into_iter().filter_map(|problem| led_back(problem, &removed)));
    }
    problems.extend(outside);
    problems.iter_mut().for_each(|problem| overrides::blame(problem, settings));
    match (sweep, problems.is_empty()) {
        (Some(sweep), true) => Ok(sweep),
        _ => Err(problems),
    }
}

fn gather_profile(text: &str) -> Result<SlurmSection, Vec<Problem>> {
    let value = yaml::mapping(text, "a profile is a mapping with the keys of `engine.slurm`");
    let mut problems = Vec::new();
    let value = value.map_err(|problem| vec![problem])?;
    let value = Value::Mapping(value);
    let outside = typed::outside_of_profile(&value);
    let section: Option<SlurmSection> = typed(value, &mut RemovedEntries::default(), &mut problems);
    problems.extend(outside);
    problems.extend(section.iter().flat_map(|section| engine::slurm(section, "")));
    match (section, problems.is_empty()) {
        (Some(section), true) => Ok(section),
        _ => Err(problems),
    }
}

/// A problem of the rest, at its place in the file; `None` if it may only come from a removed entry: a list that is
/// too short.
fn led_back(problem: Problem, removed: &RemovedEntries) -> Option<Problem> {
    let axes = ["grid.models", "grid.vocab", "grid.budgets"];
    let zipped = problem.path.starts_with("grid.zip");
    let spoiled = removed.shortened(&problem.path)
        || zipped && axes.iter().any(|axis| removed.shortened(axis));
    let path = removed.in_the_file(&problem.path);
    (!spoiled).then_some(Problem { path, ..problem })
}

#[cfg(test)]
mod tests {
    use super::{SweepErrors, parse};

    fn errors(text: &str, settings: &[&str]) -> SweepErrors {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        parse("sweep.yaml", text, &settings).expect_err("something is wrong")
    }

    #[test]
    fn scores_take_the_sampling_of_the_sweep_for_keys_that_they_leave_out() {
        let text = "name: a\ngrid: {models: scamo, vocab: [64], budgets: [1e18]}\nevaluator: {}\n\
                    sampling: {guidance: 4, top_p: 0.9, rounds: 18}\n";
        let read = |scores: &str| parse("a.yaml", &format!("{text}{scores}"), &[]).expect("right");
        let sweep = read("scores: {guidance: 0, repeats: 3}\n");
        let scores = sweep.scores.clone().expect("a section");
        assert_eq!((scores.guidance, scores.repeats), (0.0, 3), "its own");
        assert_eq!((scores.top_p, scores.rounds, scores.temperature), (Some(0.9), 18, 1.0));
        let again = serde_yaml::to_string(&sweep).expect("YAML");
        assert_eq!(parse("a.yaml", &again, &[]).expect("right"), sweep, "as it is kept");
        assert_eq!(read("").scores, None, "sampling scores nothing");
        let wrong = errors(&text.replace("0.9", "9"), &[]).to_string();
        assert!(wrong.contains("9 is out of range") && wrong.contains("sweep.yaml:4"), "{wrong}");
    }

    #[test]
    fn a_slip_within_a_list_of_models_is_found_where_it_stands() {
        let errors = errors(
            "name: a\ngrid:\n  models: [{n_layer: 1, n_heads: 2, d_model: 8}]\n  vocab: [64]\n",
            &[],
        );
        let paths: Vec<&str> = errors.problems.iter().map(|p| p.path.as_str()).collect();
        assert_eq!(paths, ["grid.models[0].n_heads", "grid.models[0]", "grid"]);
        assert_eq!(errors.problems[0].help.as_deref(), Some("did you mean `n_head`?"));
        assert!(errors.problems[1].message.contains("missing field `n_head`"));
        assert!(errors.problems[2].message.contains("missing field `budgets`"));
        let text = errors.render(false);
        assert!(text.contains("sweep.yaml:3:25") && text.contains("^^^^^^^"), "{text}");
    }

    #[test]
    fn a_setting_is_blamed_for_what_it_says_and_not_the_line_that_it_replaces() {
        let text = "name: a\ngrid: {models: scamo, vocab: [64], budgets: [1e18]}\n\
                    train: {min_steps: 9}\n";
        let errors = errors(text, &["train.min_steps=many"]);
        assert_eq!(errors.problems.len(), 1);
        let text = errors.render(false);
        assert!(text.contains("in --set train.min_steps=many"), "{text}");
        assert!(!text.contains("min_steps: 9"), "{text}");
    }

    #[test]
    fn a_setting_of_a_whole_section_is_told_which_of_its_keys_is_at_fault() {
        let text = "name: a\ngrid: {models: scamo, vocab: [64], budgets: [1e18]}\n";
        let setting = "tokenizer.plateau={evaluations: 0}";
        let text = errors(text, &[setting]).render(false);
        let told = format!("at tokenizer.plateau.evaluations in --set {setting}");
        assert!(text.contains(&told), "{text}");
    }

    #[test]
    fn of_many_wrong_keys_the_first_are_told() {
        let keys: String = (0..99).map(|i| format!("k{i}: 1\n")).collect();
        let errors = errors(&keys, &[]);
        assert_eq!(errors.problems.len(), 21);
        assert!(errors.problems[20].message.contains("mend these first"));
    }

    #[test]
    fn a_text_that_is_not_yaml_is_shown_where_it_breaks() {
        let text = errors("name: a\ngrid: {models: scamo\nseeds: ä\n", &[]).render(false);
        assert!(text.contains("not valid YAML") && text.contains("sweep.yaml:3"), "{text}");
    }
}
