//! `isoflop data check`: every file of a data set, and all that is wrong.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use isoflop::data::{self, Split, check_folder};
use isoflop::spec::{DataSection, DataSource};
use serde_json::json;

use crate::commands::doubts::too_few;
use crate::commands::exit::Exit;
use crate::commands::output::{Output, many, more};

#[derive(Args)]
pub struct CheckArgs {
    /// A folder in the HumanML3D layout
    data: PathBuf,
}

/// Sentences of a kind that are told, at most.
const TOLD: usize = 20;

pub fn check(args: &CheckArgs, output: &Output) -> Result<Exit> {
    let mut found = check_folder(&args.data);
    found.remarks.extend(small_test(&args.data));
    let limit = if output.full { usize::MAX } else { TOLD };
    let list = |title: &str, lines: &[String]| {
        let mut text = if lines.is_empty() { String::new() } else { format!("{title}\n") };
        lines.iter().take(limit).for_each(|line| text += &format!("  {line}\n"));
        text + &more(lines.len(), limit, ": --full")
    };
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

/// Frames of a code, as most tokenizers have them.
const FRAMES_PER_CODE: f64 = 4.0;

/// On a test split that is too small to measure a loss; nothing of a folder that cannot be opened.
fn small_test(path: &Path) -> Option<String> {
    let path = Some(path.to_path_buf());
    let section = DataSection { source: DataSource::HumanMl3d, path, ..DataSection::default() };
    let source = data::open(&section, None).ok()?;
    let frames = (0..source.n_clips(Split::Test)).map(|i| source.n_frames(Split::Test, i));
    let codes = frames.sum::<usize>() as f64 / FRAMES_PER_CODE;
    let (clips, groups) = (source.n_clips(Split::Test), data::test_groups(&*source));
    let [what, mend] = too_few(codes, clips, groups)?;
    Some(format!("{what}; {mend}"))
}
