//! [`Waiting`]: jobs that nobody has begun, and which of them could be.

use std::collections::{BTreeSet, HashMap};

use crate::jobs::{Job, JobId};

/// Jobs in their order of urgency, each ready once all that it needs is there.
#[derive(Debug, Default)]
pub struct Waiting {
    jobs: Vec<Option<Job>>,
    /// How many needs of each are open.
    open: Vec<usize>,
    needed_by: HashMap<JobId, Vec<usize>>,
    ready: BTreeSet<usize>,
    /// How many others were let past each.
    passed: Vec<usize>,
}

/// Others that are let past a job for which there is not enough memory yet.
const MOST_PASSED: usize = 16;

impl Waiting {
    /// Jobs, the most urgent first; what one needs must be among them.
    pub fn new(jobs: Vec<Job>) -> Self {
        let mut needed_by: HashMap<JobId, Vec<usize>> = HashMap::new();
        for (index, job) in jobs.iter().enumerate() {
            for need in &job.needs {
                needed_by.entry(need.clone()).or_default().push(index);
            }
        }
        let open: Vec<usize> = jobs.iter().map(|job| job.needs.len()).collect();
        let ready = (0..jobs.len()).filter(|&index| open[index] == 0).collect();
        let passed = vec![0; jobs.len()];
        Self { jobs: jobs.into_iter().map(Some).collect(), open, needed_by, ready, passed }
    }

    /// Takes the most urgent job that is ready and that `fits`. What fits is let past one that does
    /// not, but not for ever.
    pub fn take(&mut self, fits: impl Fn(&Job) -> bool) -> Option<Job> {
        let index = self.first_fit(&fits)?;
        for passed in self.ready.range(..index) {
            self.passed[*passed] += 1;
        }
        self.ready.remove(&index);
        self.jobs[index].take()
    }

    fn first_fit(&self, fits: impl Fn(&Job) -> bool) -> Option<usize> {
        for &index in &self.ready {
            if self.jobs[index].as_ref().is_some_and(&fits) {
                return Some(index);
            }
            if self.passed[index] >= MOST_PASSED {
                return None;
            }
        }
        None
    }

    /// Puts a job back that was taken, behind all others.
    pub fn put_back(&mut self, job: Job) {
        self.ready.insert(self.jobs.len());
        self.jobs.push(Some(job));
        self.open.push(0);
        self.passed.push(0);
    }

    /// What needs a job that is done now needs one less.
    pub fn is_there(&mut self, id: &JobId) {
        for index in self.needed_by.remove(id).unwrap_or_default() {
            self.open[index] -= 1;
            if self.open[index] == 0 {
                self.ready.insert(index);
            }
        }
    }

    /// Takes out all that needs, at any remove, a job that will not come.
    pub fn is_lost(&mut self, id: &JobId) -> Vec<Job> {
        let orphans = self.needed_by.remove(id).unwrap_or_default();
        let orphans: Vec<Job> = orphans.into_iter().filter_map(|i| self.jobs[i].take()).collect();
        let further: Vec<Job> = orphans.iter().flat_map(|job| self.is_lost(&job.id)).collect();
        orphans.into_iter().chain(further).collect()
    }

    /// Takes out all that is left.
    pub fn drain(&mut self) -> Vec<Job> {
        self.ready.clear();
        self.jobs.iter_mut().filter_map(Option::take).collect()
    }
}

#[cfg(test)]
mod tests;
