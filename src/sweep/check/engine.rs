//! Checks of the `engine` section and of a profile file, beyond types.

use crate::machine::{self, CARDS};
use crate::sweep::problem::{Problem, nearest};
use crate::sweep::sections::{EngineSection, Resources, SlurmSection, Stage, Sweep, minutes};

/// Arguments of `sbatch` that isoflop gives itself.
const OURS: &str = "--array -a --dependency -d --parsable --output -o --open-mode --wrap --comment \
                    --chdir -D --signal --kill-on-invalid-dep";

/// Problems of a sweep's section.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let Some(section) = &sweep.engine else { return Vec::new() };
    gpu(section).into_iter().chain(slurm(&section.slurm, "engine.slurm.")).collect()
}

/// A card that is not known.
fn gpu(section: &EngineSection) -> Vec<Problem> {
    let unknown = section.gpu.as_ref().filter(|name| machine::find(name).is_none());
    let unknown = unknown.map(|name| {
        let names = CARDS.each_ref().map(|card| card.name);
        Problem::value("engine.gpu", format!("no card is named `{name}`"))
            .with_help(nearest(name, &names))
    });
    unknown.into_iter().collect()
}

/// Problems of a section with its keys under `prefix`.
pub fn slurm(section: &SlurmSection, prefix: &str) -> Vec<Problem> {
    let mut problems = resources(&section.resources(), prefix);
    for (stage, of_stage) in section.stages.iter().flatten() {
        let under = format!("{prefix}stages.{}.", stage.word());
        problems.extend(resources(of_stage, &under));
        let both = of_stage.clone().over(section.resources());
        problems.extend(time(&both, section, *stage, prefix));
    }
    if section.stages.as_ref().is_none_or(|stages| !stages.contains_key(&Stage::Train)) {
        problems.extend(time(&section.resources(), section, Stage::Train, prefix));
    }
    problems.extend(programs(section, prefix));
    problems
}

fn resources(of: &Resources, prefix: &str) -> Vec<Problem> {
    let mut problems = Vec::new();
    let memory = [&of.mem, &of.mem_per_cpu, &of.mem_per_gpu];
    if memory.iter().filter(|key| key.is_some()).count() > 1 {
        let message = "`mem`, `mem_per_cpu` and `mem_per_gpu` exclude one another";
        let key = if of.mem_per_cpu.is_some() { "mem_per_cpu" } else { "mem_per_gpu" };
        problems.push(Problem::value(format!("{prefix}{key}"), message));
    }
    if let Some(time) = of.time.as_ref().filter(|time| minutes(&time.0).is_none()) {
        let message = format!("`{}` is no time limit that Slurm knows", time.0);
        let help = "write minutes as 90, or 04:00:00, or 2-12:00:00";
        problems.push(Problem::value(format!("{prefix}time"), message).with_help(help));
    }
    problems.extend(extra(of, prefix));
    problems.extend(env(of, prefix));
    problems
}

/// Whether the warning comes before the end, with time left to work.
fn time(of: &Resources, section: &SlurmSection, stage: Stage, prefix: &str) -> Option<Problem> {
    let limit = of.time.as_ref().and_then(|time| minutes(&time.0))?;
    let grace = section.signal_grace_s.map(|count| count.0 as f64)?;
    (stage != Stage::Fit && grace >= 60.0 * limit).then(|| {
        let message = format!("a warning {grace} s before the end of {limit} min leaves no time");
        Problem::value(format!("{prefix}signal_grace_s"), message)
    })
}

fn extra(of: &Resources, prefix: &str) -> Vec<Problem> {
    let problem = |(i, word): (usize, &String)| {
        let given = word.split('=').next()?;
        let name = OURS.split(' ').find(|ours| *ours == given)?;
        let message = format!("isoflop gives `{name}` itself");
        Some(Problem::value(format!("{prefix}extra[{i}]"), message).with_help("leave it out"))
    };
    of.extra.iter().flatten().enumerate().filter_map(problem).collect()
}

fn env(of: &Resources, prefix: &str) -> Vec<Problem> {
    let good = |name: &str| {
        let letters = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        letters && !name.is_empty() && !name.starts_with(|c: char| c.is_ascii_digit())
    };
    let names = of.env.iter().flat_map(|env| env.keys());
    let wrong = names.filter(|name| !good(name));
    let problem = |name: &String| {
        Problem::value(format!("{prefix}env"), format!("`{name}` cannot name a variable"))
    };
    wrong.map(problem).collect()
}

fn programs(section: &SlurmSection, prefix: &str) -> Vec<Problem> {
    let programs = [
        ("sbatch", &section.sbatch),
        ("squeue", &section.squeue),
        ("scancel", &section.scancel),
        ("scontrol", &section.scontrol),
    ];
    let empty = |text: &String| shlex::split(text).is_none_or(|words| words.is_empty());
    let wrong = programs.into_iter().filter(|(_, text)| text.as_ref().is_some_and(empty));
    wrong.map(|(key, _)| Problem::value(format!("{prefix}{key}"), "is no command")).collect()
}
