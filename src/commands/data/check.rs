//! `isoflop data check`: every file of a data set, and all that is wrong.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use isoflop::data::check_folder;
use serde_json::json;

use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
pub struct CheckArgs {
    /// A folder in the HumanML3D layout
    data: PathBuf,
}

/// Sentences of a kind that are told, at most.
const TOLD: usize = 20;

pub fn check(args: &CheckArgs, output: &Output) -> Result<Exit> {
    let found = check_folder(&args.data);
    let limit = if output.full { usize::MAX } else { TOLD };
    let list = |title: &str, lines: &[String]| {
        let mut text = if lines.is_empty() { String::new() } else { format!("{title}\n") };
        lines.iter().take(limit).for_each(|line| text += &format!("  {line}\n"));
        if lines.len() > limit {
            text += &format!("  and {} more: --full\n", lines.len() - limit);
        }
        text
    };
    let many = |n: usize, noun: &str| format!("{n} {noun}{}", if n == 1 { "" } else { "s" });
    let (problems, remarks) = (found.problems.len(), found.remarks.len());
    let text = format!(
        "{}: {}, {}\n{}{}",
        args.data.display(),
        many(problems, "problem"),
        many(remarks, "remark"),
        list("problems", &found.problems),
        list("remarks", &found.remarks)
    );
    output.result(&json!(found), &text)?;
    Ok(if found.problems.is_empty() { Exit::Done } else { Exit::SomeRunsFailed })
}
