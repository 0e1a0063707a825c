//! The dependency graph of jobs: [`missing_jobs`] lists the unfinished jobs of a plan.

use std::collections::{HashMap, HashSet};

use super::folder::{JobState, ResultsFolder};
use super::job::{Job, JobId, JobKind};
use crate::plan::Plan;

/// All jobs of a plan except runs: their dependencies, in order, and their dependents.
pub fn inputs(plan: &Plan) -> Vec<Job> {
    let kinds = JobKind::ALL.into_iter().filter(|kind| *kind != JobKind::Run);
    kinds.flat_map(|kind| kind.jobs(plan)).collect()
}

/// Every job of a plan, including finished ones, in order of dependency.
pub fn all_jobs(plan: &Plan) -> impl Iterator<Item = Job> {
    JobKind::ALL.into_iter().flat_map(|kind| kind.jobs(plan))
}

/// The unfinished jobs that can be done, the most urgent first: those with the longest chain of dependent work.
///
/// Failed jobs and their dependents are left out; finished jobs are no dependencies.
pub fn missing_jobs(plan: &Plan, folder: &ResultsFolder) -> Vec<Job> {
    let is_open = |state| matches!(state, JobState::Missing | JobState::Started);
    let open = |id: &JobId| is_open(folder.state(id));
    let (runs, states) = (JobKind::Run.jobs(plan), folder.run_states());
    let before_others: HashSet<JobId> = runs.iter().flat_map(|run| run.needs.clone()).collect();
    let goals = runs.into_iter().filter(|run| is_open(states.of(&run.id.id)));
    let (first, goals): (Vec<Job>, Vec<Job>) =
        goals.partition(|run| before_others.contains(&run.id));
    let inputs = inputs(plan);
    // Codes may be there though the metrics of their tokenizer are not any more.
    let made = inputs.iter().filter(|job| folder.state(&job.id) == JobState::Done);
    let needs = made.flat_map(|job| job.needs.clone());
    let lost: Vec<JobId> = needs.filter(|id| id.kind.is_result() && open(id)).collect();
    let tried: Vec<JobId> = first.iter().map(|run| run.id.clone()).collect();
    let mut wanted = Wanted::new(inputs.into_iter().chain(first), folder);
    for run in &tried {
        wanted.availability(run);
    }
    let goals: Vec<Job> = goals.into_iter().filter_map(|job| wanted.take(job)).collect();
    for need in &lost {
        wanted.availability(need);
    }
    let mut jobs = std::mem::take(&mut wanted.jobs);
    let followers = JobKind::ALL.into_iter().filter(|kind| *kind > JobKind::Run);
    let followers: Vec<Job> = followers.flat_map(|kind| kind.jobs(plan)).collect();
    if !followers.is_empty() {
        let to_do = goals.iter().map(|job| (job.id.clone(), Availability::ToDo));
        wanted.known.extend(to_do.collect::<Vec<_>>());
    }
    for follower in followers.iter().filter(|job| open(&job.id)) {
        wanted.availability(&follower.id);
    }
    jobs.extend(goals);
    jobs.append(&mut wanted.jobs);
    by_urgency(jobs)
}

/// The wanted jobs among missing ones, and their dependencies, in the same order.
pub fn with_needs(mut jobs: Vec<Job>, is_wanted: impl Fn(&Job) -> bool) -> Vec<Job> {
    let wanted = jobs.iter().filter(|job| is_wanted(job));
    let mut kept: HashSet<JobId> = wanted.map(|job| job.id.clone()).collect();
    // Dependencies are at least as urgent, and come first.
    for job in jobs.iter().rev() {
        if kept.contains(&job.id) {
            kept.extend(job.needs.iter().cloned());
        }
    }
    jobs.retain(|job| kept.contains(&job.id));
    jobs
}

/// Picks the dependencies out of all inputs, in the order of the runs.
struct Wanted<'a> {
    folder: &'a ResultsFolder,
    inputs: HashMap<JobId, Job>,
    /// Whether each input that was asked for can be had, and whether it is still to be made.
    known: HashMap<JobId, Availability>,
    jobs: Vec<Job>,
}

#[derive(Clone, Copy, PartialEq)]
enum Availability {
    There,
    ToDo,
    Lost,
}

impl<'a> Wanted<'a> {
    fn new(inputs: impl IntoIterator<Item = Job>, folder: &'a ResultsFolder) -> Self {
        let inputs = inputs.into_iter().map(|job| (job.id.clone(), job)).collect();
        Self { folder, inputs, known: HashMap::new(), jobs: Vec::new() }
    }

    /// The job with only those needs left that are still to be made; `None` if one is lost.
    fn take(&mut self, mut job: Job) -> Option<Job> {
        let needed: Vec<Availability> =
            job.needs.iter().map(|need| self.availability(need)).collect();
        let mut each = needed.iter();
        job.needs.retain(|_| each.next() == Some(&Availability::ToDo));
        (!needed.contains(&Availability::Lost)).then_some(job)
    }

    fn availability(&mut self, id: &JobId) -> Availability {
        if let Some(known) = self.known.get(id) {
            return *known;
        }
        let found = match (self.folder.state(id), self.inputs.get(id).cloned()) {
            (JobState::Done, _) => Availability::There,
            (JobState::Failed, _) | (_, None) => Availability::Lost,
            (_, Some(job)) => match self.take(job) {
                Some(job) => {
                    self.jobs.push(job);
                    Availability::ToDo
                }
                None => Availability::Lost,
            },
        };
        self.known.insert(id.clone(), found);
        found
    }
}

/// Sorts jobs by the work of the longest chain that begins with each, longest first.
fn by_urgency(jobs: Vec<Job>) -> Vec<Job> {
    let mut waiting: HashMap<&JobId, f64> = HashMap::new();
    let mut urgency = vec![0.0; jobs.len()];
    // Dependents come later, so going backwards every one is known when needed.
    for (job, urgency) in jobs.iter().zip(&mut urgency).rev() {
        *urgency = job.cost + waiting.get(&job.id).copied().unwrap_or(0.0);
        for need in &job.needs {
            let chain = waiting.entry(need).or_insert(0.0);
            *chain = chain.max(*urgency);
        }
    }
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by(|&a, &b| urgency[b].total_cmp(&urgency[a]));
    let mut jobs: Vec<Option<Job>> = jobs.into_iter().map(Some).collect();
    order.into_iter().filter_map(|i| jobs[i].take()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::DataFacts;
    use crate::files::atomic::write_json;
    use crate::sweep;

    /// Two runs that are scored by one evaluator.
    fn plan() -> Plan {
        let text = "name: a\ndata: {clips: 64}\nevaluator: {}\nscores: {}\ngrid: {models: [{n_layer: 1, \
                    n_head: 2, d_model: 16}, {n_layer: 1, n_head: 2, d_model: 32}], vocab: [64], budgets: [1e10]}\n";
        let sweep = sweep::parse("a.yaml", text, &[]).unwrap();
        Plan::new(&sweep, DataFacts::absent("none".to_string()))
    }

    fn words(jobs: &[Job]) -> Vec<&str> {
        let mut words: Vec<&str> = jobs.iter().map(|job| job.id.kind.word()).collect();
        words.sort_unstable();
        words
    }

    #[test]
    fn scores_wait_for_their_runs_and_the_one_evaluator() {
        let place = tempfile::tempdir().unwrap();
        let (plan, folder) = (plan(), ResultsFolder::new(place.path()));
        let jobs = missing_jobs(&plan, &folder);
        let all = ["evaluator", "run", "run", "score", "score", "text", "tokenizer", "tokens"];
        assert_eq!(words(&jobs), all);
        for score in jobs.iter().filter(|job| job.id.kind.word() == "score") {
            let needs: Vec<&str> = score.needs.iter().map(|need| need.kind.word()).collect();
            assert_eq!(needs, ["run", "evaluator"]);
        }
        let before = |job: &Job, need: &JobId| {
            let place = |id: &JobId| jobs.iter().position(|job| job.id == *id);
            place(need) < place(&job.id)
        };
        assert!(jobs.iter().all(|job| job.needs.iter().all(|need| before(job, need))));
    }

    #[test]
    fn a_score_of_a_run_that_is_there_is_all_that_is_missing() {
        let place = tempfile::tempdir().unwrap();
        let (plan, folder) = (plan(), ResultsFolder::new(place.path()));
        let scores: Vec<Job> =
            all_jobs(&plan).filter(|job| job.id.kind.word() == "score").collect();
        for done in all_jobs(&plan).filter(|job| job.id != scores[1].id) {
            write_json(&folder.product(&done.id), &serde_json::json!({})).unwrap();
        }
        let jobs = missing_jobs(&plan, &folder);
        assert_eq!(jobs.iter().map(|job| &job.id).collect::<Vec<_>>(), [&scores[1].id]);
        assert!(jobs[0].needs.is_empty());
    }
}
