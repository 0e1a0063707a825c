//! [`Gpus`]: divides the GPUs of this machine among parallel runs.

use std::sync::{Mutex, PoisonError};

use anyhow::{Result, bail};

use crate::sweep::Sweep;

/// The variable that tells programs their GPUs.
pub const VISIBLE: &str = "CUDA_VISIBLE_DEVICES";

/// Lists of GPUs, a slot each; a slot that is at work has taken its list.
#[derive(Debug)]
pub struct Gpus {
    free: Mutex<Vec<String>>,
}

/// A slot's list, which comes back when it is dropped.
pub struct Lent<'a> {
    gpus: &'a Gpus,
    pub list: String,
}

impl Gpus {
    /// The GPUs to divide, if the sweep's trainer names any: from `CUDA_VISIBLE_DEVICES`, if it is set for this process.
    ///
    /// # Errors
    /// The sweep names more GPUs.
    pub fn of_sweep(sweep: &Sweep, slots: usize) -> Result<Option<Self>> {
        let Some(n) = sweep.trainer.as_ref().and_then(|trainer| trainer.gpus) else {
            return Ok(None);
        };
        let names = visible().unwrap_or_else(|| (0..n).map(|gpu| gpu.to_string()).collect());
        if names.len() < n {
            bail!("trainer.gpus is {n}, and {VISIBLE} lists {}", names.len());
        }
        Ok(Some(Self::shared(&names[..n], slots)))
    }

    /// The same for a task of a scheduler that sets its GPUs: all of them are divided.
    pub fn of_task(sweep: &Sweep, slots: usize) -> Option<Self> {
        sweep.trainer.as_ref().and_then(|trainer| trainer.gpus)?;
        Some(Self::shared(&visible()?, slots))
    }

    /// Even parts of the GPUs; with more slots than GPUs, slots share one.
    fn shared(names: &[String], slots: usize) -> Self {
        let n = names.len();
        let list = |slot: usize| match slots <= n {
            true => names[slot * n / slots..(slot + 1) * n / slots].join(","),
            false => names[slot % n].clone(),
        };
        Self { free: Mutex::new((0..slots).rev().map(list).collect()) }
    }

    /// The list of a slot that is free, for as long as a run has it.
    pub fn lend(&self) -> Lent<'_> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        Lent { gpus: self, list: free.pop().unwrap_or_default() }
    }
}

/// The GPUs set for this process.
fn visible() -> Option<Vec<String>> {
    let told = std::env::var(VISIBLE).ok().filter(|list| !list.is_empty())?;
    Some(told.split(',').map(|name| name.trim().to_string()).collect())
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        let mut free = self.gpus.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(std::mem::take(&mut self.list));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lists(gpus: &[&str], slots: usize) -> Vec<String> {
        let names: Vec<String> = gpus.iter().map(|name| name.to_string()).collect();
        let gpus = Gpus::shared(&names, slots);
        let lent: Vec<Lent> = (0..slots).map(|_| gpus.lend()).collect();
        lent.iter().map(|lent| lent.list.clone()).collect()
    }

    #[test]
    fn gpus_are_parted_evenly_and_shared_where_there_are_fewer() {
        assert_eq!(lists(&["0", "1", "2", "3"], 4), ["0", "1", "2", "3"]);
        assert_eq!(lists(&["0", "1", "2", "3"], 2), ["0,1", "2,3"]);
        assert_eq!(lists(&["4", "5", "6"], 2), ["4", "5,6"]);
        assert_eq!(lists(&["0", "1"], 4), ["0", "1", "0", "1"]);
    }

    #[test]
    fn a_list_comes_back_when_its_run_has_ended() {
        let gpus = Gpus::shared(&["7".to_string()], 1);
        let first = gpus.lend();
        assert_eq!(first.list, "7");
        drop(first);
        assert_eq!(gpus.lend().list, "7");
    }
}
