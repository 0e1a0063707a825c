//! `isoflop data check`: checks every file of a data set and reports all problems.

use crate::commands::prelude::*;
use isoflop::data::{self, Split, check_folder};
use isoflop::spec::{DataSection, DataSource};

#[derive(Args)]
pub struct CheckArgs {
    /// A folder in the HumanML3D layout
    data: PathBuf,
}

/// Most sentences of a kind that are shown.
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

/// Frames per code of most tokenizers.
const FRAMES_PER_CODE: f64 = 4.0;

/// A warning if the test split is too small to measure a loss; none if the folder cannot be opened.
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

/// Standard error of the mean loss times the square root of the number of codes, in nats: 3.3 to 4.4 on 512 clips of
/// procedural motion, whose codes are correlated within a clip.
const ERROR_OF_A_CODE: f64 = 3.5;

/// Standard deviation of the mean loss over groups recorded together, in nats: 3.3 over nine performers of CMU's
/// motion, 2.4 over 27 sessions of Bandai's.
const ERROR_OF_A_GROUP: f64 = 3.0;

/// Fewer groups than this get a warning.
const FEWEST_GROUPS: usize = 36;

/// Fewer codes of the test split than this measure a loss too roughly to compare sizes.
const FEWEST_CODES: f64 = 2000.0;

/// The problem and the remedy of a test split with these codes, clips and groups; `None` if it is large enough.
pub fn too_few(codes: f64, clips: usize, groups: usize) -> Option<[String; 2]> {
    let error = |codes: f64| ERROR_OF_A_CODE / codes.sqrt();
    if groups < clips.min(FEWEST_GROUPS) {
        let of_groups = ERROR_OF_A_GROUP / (groups.max(1) as f64).sqrt();
        return Some([
            format!(
                "the test split holds {groups} groups of clips that were recorded together: all losses move \
                 by about ±{of_groups:.1} nats on others"
            ),
            "give test clips of more performers or sessions".to_string(),
        ]);
    }
    (codes < FEWEST_CODES).then(|| {
        [
            format!(
                "the test split holds about {codes:.0} codes: the mean loss is known to ±{:.2} nats",
                error(codes)
            ),
            format!(
                "{FEWEST_CODES} codes bring that to {:.2}: give more test clips",
                error(FEWEST_CODES)
            ),
        ]
    })
}
