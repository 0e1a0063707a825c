//! Files that a worker finds damaged and has made again: results depend on neither.

use std::path::Path;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;

use super::{claim, work};
use crate::record::damaged::{is_damage, set_aside};
use crate::record::{JobId, ResultsFolder};
use crate::schedule::signals::Stop;
use crate::train::weights::WeightsError;

/// Sets aside a file that is damaged, and says so in the log.
pub fn put_away(path: &Path, reason: &str, instead: &str) -> Result<()> {
    if let Some(aside) = set_aside(path)? {
        eprintln!("warning: {reason}; it is set aside as {} and {instead}", aside.display());
    }
    Ok(())
}

/// Whether an error says that this file is damaged.
pub fn is_damaged(error: &WeightsError, path: &Path) -> bool {
    let WeightsError::Read { path: of, reason } = error else { return false };
    Path::new(of) == path && is_damage(reason)
}

/// What a job has made, opened; where it is damaged or gone, the job is done again here first.
///
/// Workers that need the same file wait for the one that makes it.
pub fn open_or_remake<T, E>(
    folder: &ResultsFolder,
    job: &JobId,
    device: &Device,
    stop: &Stop,
    open: impl Fn(&Path) -> Result<T, E>,
) -> Result<T>
where
    E: std::error::Error + Send + Sync + 'static,
{
    let path = folder.product(job);
    let reason = match open(&path) {
        Err(error) if is_damage(&error.to_string()) => error.to_string(),
        opened => return Ok(opened?),
    };
    let place = folder.job(job);
    std::fs::create_dir_all(&place).with_context(|| format!("making {}", place.display()))?;
    let Some(_lock) = claim(&place, stop)? else { bail!("stopped while {job} was made again") };
    if let Ok(mended) = open(&path) {
        return Ok(mended);
    }
    put_away(&path, &reason, "made again")?;
    work(folder, job, device, "", stop)?;
    Ok(open(&path)?)
}
