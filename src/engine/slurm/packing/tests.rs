//! Tests of the module above.

use super::super::command::Answer;
use super::super::files::{ChunkFile, SlurmFolder};
use super::*;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::Duration;

use super::super::stages::{After, Array};
use super::super::submission::SubmissionTerms;
use crate::jobs::ResultsFolder;
use crate::sweep::Stage;

/// Answers `sbatch` from a list, and `squeue` with the token of the last call if the job exists; records every
/// call.
#[derive(Default)]
struct Mock {
    sbatch: RefCell<VecDeque<(bool, &'static str)>>,
    /// The answer of `squeue` for a job that `sbatch` did not confirm; `None` for no answer.
    queue: Option<&'static str>,
    calls: RefCell<Vec<Vec<String>>>,
}

impl Mock {
    fn new(sbatch: &[(bool, &'static str)], queue: Option<&'static str>) -> Self {
        Self { sbatch: RefCell::new(sbatch.iter().copied().collect()), queue, ..Self::default() }
    }

    fn calls_of(&self, program: &str) -> Vec<Vec<String>> {
        self.calls.borrow().iter().filter(|words| words[0] == program).cloned().collect()
    }

    fn last_token(&self) -> String {
        let calls = self.calls_of("sbatch");
        let words = calls.last().expect("it was called");
        words.iter().find_map(|word| word.strip_prefix("--comment=")).unwrap().to_string()
    }
}

impl Shell for Mock {
    fn call(&self, words: &[String], _: Duration) -> Result<Answer, SlurmError> {
        self.calls.borrow_mut().push(words.to_vec());
        let answer = |ok, text: String| match ok {
            true => Answer { ok, stdout: text, stderr: String::new() },
            false => Answer { ok, stdout: String::new(), stderr: text },
        };
        Ok(match words[0].as_str() {
            "sbatch" => {
                let (ok, text) = self.sbatch.borrow_mut().pop_front().expect("one call more");
                answer(ok, text.to_string())
            }
            "squeue" => match self.queue {
                Some(line) => answer(true, format!("{line}{}\n", self.last_token())),
                None => answer(false, "Unable to contact slurm controller".to_string()),
            },
            _ => answer(true, String::new()),
        })
    }
}

/// One input, an array that waits for it, and the fit.
fn submission(place: &tempfile::TempDir) -> Submission {
    let array = |name: &str, stage, after| Array {
        name: name.to_string(),
        stage,
        chunks: vec![ChunkFile::default()],
        after,
    };
    Submission {
        written: SubmissionTerms {
            settings: Settings::default(),
            device: "flex".to_string(),
            program: "d1".to_string(),
            flops_per_second: 1e9,
            track: None,
        },
        folder: ResultsFolder::new(place.path().join("my sweep")),
        generation: 3,
        directory: place.path().to_path_buf(),
        steps: vec![
            array("inputs", Stage::Inputs, Vec::new()),
            array("train", Stage::Train, vec![After::Ours { array: 0, index: 0 }]),
            Array::fit(),
        ],
        queued: vec!["5".to_string()],
    }
}

/// The result of a submission, and the ledger after it.
fn go(mock: &Mock) -> (Result<Vec<Entry>, SlurmError>, Vec<Entry>) {
    let place = tempfile::tempdir().unwrap();
    let submission = submission(&place);
    let ended = submit(&submission, 1000, mock);
    assert!(submission.files().logs().exists());
    (ended, SlurmFolder::of(&submission.folder).entries().unwrap())
}

#[test]
fn each_step_waits_for_the_numbers_just_given() {
    let mock = Mock::new(&[(true, "11\n"), (true, "Welcome!\n12;alpha\n"), (true, "13\n")], None);
    let (ended, entries) = go(&mock);
    let ids: Vec<String> = ended.unwrap().into_iter().filter_map(|job| job.job_id).collect();
    assert_eq!(ids, ["11", "12", "13"]);
    assert_eq!(entries.len(), 3);
    let calls = mock.calls_of("sbatch");
    let waits = |at: usize| calls[at].iter().find(|word| word.starts_with("--dependency"));
    assert_eq!(waits(0), None);
    assert_eq!(waits(1).unwrap(), "--dependency=afterok:11_0");
    assert_eq!(waits(2).unwrap(), "--dependency=afterany:11:12:5");
    assert!(calls[0].contains(&"--job-name=my sweep-inputs".to_string()));
}

#[test]
fn a_refusal_takes_back_what_was_submitted_before() {
    let refusal = "sbatch: error: AssocMaxSubmitJobLimit";
    let mock = Mock::new(&[(true, "11\n"), (true, "12\n"), (false, refusal)], Some(""));
    let (ended, entries) = go(&mock);
    assert!(ended.unwrap_err().is_submit_limit());
    assert_eq!(mock.calls_of("scancel"), [["scancel", "12", "11"]]);
    assert_eq!(entries, []);
}

#[test]
fn a_lost_answer_is_looked_for_and_not_asked_for_twice() {
    let lost = (false, "sbatch: error: Batch job submission failed: Socket timed out");
    let queue = Some("12|0|PENDING|None||");
    let mock = Mock::new(&[(true, "11\n"), lost, (true, "13\n")], queue);
    let (ended, _) = go(&mock);
    assert_eq!(ended.unwrap()[1].job_id.as_deref(), Some("12"));
    assert_eq!(mock.calls_of("sbatch").len(), 3);
}

#[test]
fn what_cannot_be_known_stays_in_the_ledger() {
    let lost = (false, "sbatch: error: Unable to contact slurm controller");
    let mock = Mock::new(&[(true, "11\n"), lost], None);
    let (ended, entries) = go(&mock);
    assert!(ended.unwrap_err().may_pass());
    // The first was cancelled; whether the second came to be is settled by the next command.
    assert_eq!(entries.len(), 1);
    assert_eq!((entries[0].array.as_str(), &entries[0].job_id), ("train", &None));
}

#[test]
fn a_number_is_the_last_line_before_a_cluster() {
    assert_eq!(number("banner\n42;alpha\n\n").unwrap(), "42");
    for text in ["", "Submitted batch job 42", "banner"] {
        assert!(number(text).is_err(), "{text}");
    }
}
