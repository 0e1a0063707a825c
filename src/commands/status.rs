//! `isoflop status`: the progress of a sweep, from its folder and from its engines.

use super::args::FolderArg;
use super::prelude::*;
use super::run::CommandLine;
use isoflop::engine::local::left;
use isoflop::engine::{Cancelled, ENGINES, EngineState};
use isoflop::jobs::{Counts, FailedJob, Running, SweepState, sweep_state};

pub fn status(args: &FolderArg, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let state = state_of(&folder)?;
    let (document, text) = told(&folder, &state)?;
    state.warnings.iter().for_each(|line| output.warn(line));
    output.result(&document, &text)
}

/// The progress of a sweep; an error if the folder is not a sweep's.
pub fn state_of(folder: &ResultsFolder) -> Result<SweepState> {
    match sweep_state(folder)? {
        Some(state) => Ok(state),
        None => bail!(
            "{0} is not a sweep's folder: it has no plan.json, which `isoflop run` writes first",
            folder.root().display()
        ),
    }
}

/// A state as JSON and as text, with the report of each engine that runs jobs of the sweep, and each failure with
/// the command that retries it.
pub fn told(folder: &ResultsFolder, state: &SweepState) -> Result<(Value, String)> {
    let command = CommandLine::read(folder)?;
    let here = std::env::current_dir().unwrap_or_default();
    let mut engines = Vec::new();
    for engine in ENGINES {
        engines.extend(engine.status(folder, state)?.map(|said| (engine.name(), said)));
    }
    let mut document = json!(state);
    document["name"] = json!(folder.name());
    document["results"] = json!(folder.root());
    let shown = document["failures"].as_array_mut().into_iter().flatten();
    for (shown, failed) in shown.zip(&state.failures) {
        shown["retry"] = json!(command.said(Some(&here), &["--retry", &failed.id.id]));
        shown["log"] = json!(folder.job(&failed.id).join("log.txt"));
    }
    for (name, said) in &engines {
        document[*name] = said.document.clone();
    }
    let text = text(&folder.name(), state, &engines, &|more| command.said(Some(&here), more));
    Ok((document, text))
}

// The text of `isoflop status` and `isoflop cancel`, within 80 columns.

const WIDTH: usize = 80;

/// Failures that are shown in full; `--json` has all.
const SHOWN: usize = 10;

/// The last lines of a failure that are shown.
const LAST_LINES: usize = 3;

/// The whole text; `command` gives the command that made the folder, with more options.
pub fn text(
    name: &str,
    state: &SweepState,
    engines: &[(&str, EngineState)],
    command: &dyn Fn(&[&str]) -> String,
) -> String {
    let parts = [
        heading(name, state, engines),
        counts(state),
        running(&state.running),
        failures(state, command),
        advice(state, engines, &command(&[])),
    ];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("\n")
}

fn heading(name: &str, state: &SweepState, engines: &[(&str, EngineState)]) -> String {
    let share = if state.flops_total > 0.0 { state.flops_done / state.flops_total } else { 1.0 };
    let mut sentence = format!(
        "{} of {} runs done, {:.1} % of {:.2e} FLOPs",
        state.runs.done,
        state.runs.total(),
        // Not 100 before all is done.
        if share < 1.0 { (1000.0 * share).floor() / 10.0 } else { 100.0 },
        state.flops_total
    );
    if let Some(eta) = state.eta_s {
        let jobs = state.running.len();
        sentence += &format!(", {} with {jobs} at work", left(eta));
    }
    let who = match (engines, &state.scheduler) {
        ([_, ..], _) if !state.at_work => engines.iter().map(|(_, said)| &*said.text).collect(),
        (_, Some(one)) => format!("at work: process {} on {}\n", one.pid, one.host),
        _ if state.at_work => "at work: a process that has just begun\n".to_string(),
        _ => "no scheduler is running here\n".to_string(),
    };
    wrap(&format!("{name}: "), &sentence) + &who
}

fn counts(state: &SweepState) -> String {
    let row = |name: &str, c: &Counts| {
        let [a, b, c, d, e] =
            [c.done, c.failed, c.running, c.started, c.missing].map(|n| n.to_string());
        [name.to_string(), a, b, c, d, e]
    };
    let inputs = state.inputs.iter().map(|(kind, of_kind)| row(kind.plural(), of_kind));
    let heads = ["<", "done", "failed", "running", "started", "missing"];
    let mut out = table(heads, inputs.chain([row("runs", &state.runs)]));
    if state.runs.blocked > 0 {
        out +=
            &format!("{} runs not started: a job that they depend on failed\n", state.runs.blocked);
    }
    out
}

fn running(running: &[Running]) -> String {
    if running.is_empty() {
        return String::new();
    }
    let line = |job: &Running| {
        let far = match &job.progress {
            Some(beat) => format!("step {} of {}, loss {:.3}", beat.step, beat.steps, beat.loss),
            None => "before its first step".to_string(),
        };
        clip(&format!("  {}: {far}", job.label), WIDTH) + "\n"
    };
    "running\n".to_string() + &running.iter().map(line).collect::<String>()
}

fn failures(state: &SweepState, command: &dyn Fn(&[&str]) -> String) -> String {
    if state.failures.is_empty() {
        return String::new();
    }
    let mut out = "failed\n".to_string();
    for job in state.failures.iter().take(SHOWN) {
        out += &failure(job);
        let again = command(&["--retry", &job.id.id]);
        out += &(CommandLine::broken("    again: ", &again) + "\n");
    }
    out += &more(state.failures.len(), SHOWN, "; --json has them all");
    let retry = CommandLine::broken("  ", &command(&["--retry-failed"]));
    out + "to try again what failed:\n" + &retry + "\n"
}

fn failure(job: &FailedJob) -> String {
    let FailedJob { label, failure_kind, reason, last_lines: lines, .. } = job;
    let mut out = wrap(&format!("  {label} [{}]: ", failure_kind.word()), reason);
    for line in &lines[lines.len().saturating_sub(LAST_LINES)..] {
        out += &(clip(&format!("    | {line}"), WIDTH) + "\n");
    }
    out
}

/// The command that continues, if jobs are left and nothing runs them.
fn advice(state: &SweepState, engines: &[(&str, EngineState)], go_on: &str) -> String {
    let runs = &state.runs;
    let open = runs.started + runs.missing - runs.blocked.min(runs.started + runs.missing);
    let in_hand = state.at_work || engines.iter().any(|(_, said)| !said.wants_more);
    if in_hand || open == 0 {
        return String::new();
    }
    format!("to go on:\n{}\n", CommandLine::broken("  ", go_on))
}

// `isoflop cancel`: ends a sweep as Ctrl-C would, wherever it runs.

pub fn cancel(args: &FolderArg, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    state_of(&folder)?;
    let mut end = Cancelled::NothingRan;
    // Engines that start work elsewhere come first.
    for engine in ENGINES.into_iter().rev() {
        let asking = || format!("asking the engine {} to end", engine.name());
        end = end.max(engine.cancel(&folder, output).with_context(asking)?);
    }
    let state = state_of(&folder)?;
    let said = match end {
        Cancelled::NothingRan => "nothing is running here",
        Cancelled::Ended => "ended; finished jobs are kept",
        Cancelled::Killed => "ended, some of it by force; finished jobs are kept",
        Cancelled::StillAtWork => {
            "still running a minute after it was asked to end; it may yet end"
        }
    };
    let (state, text) = told(&folder, &state)?;
    let document = json!({
        "was_running": end != Cancelled::NothingRan,
        "ended": end != Cancelled::StillAtWork,
        "state": state,
    });
    output.result(&document, &format!("{said}\n\n{text}"))?;
    Ok(if end == Cancelled::StillAtWork { Exit::SomeRunsFailed } else { Exit::Done })
}
