//! [`SweepRequest`]: what is asked of an engine for a sweep.

use std::path::Path;

use super::Track;
use crate::jobs::ResultsFolder;
use crate::ops::DeviceName;
use crate::plan::Plan;
use crate::sweep::Sweep;

/// What is asked of an engine for a sweep.
#[derive(Clone, Copy)]
pub struct SweepRequest<'a> {
    /// As resolved.
    pub sweep: &'a Sweep,
    pub plan: &'a Plan,
    pub folder: &'a ResultsFolder,
    pub device: DeviceName,
    /// Jobs side by side on this machine.
    pub slots: usize,
    /// Memory for all jobs together; `None`: what is available.
    pub memory_bytes: Option<u64>,
    /// Stop at the first failure.
    pub fail_fast: bool,
    /// A file with keys of the engine's section, laid over those of the sweep.
    pub profile: Option<&'a Path>,
    /// The tracker that follows training, if one does.
    pub track: Option<Track>,
    pub tell: &'a dyn Tell,
}

/// Whom an engine tells what is no result.
pub trait Tell {
    /// Something worth knowing.
    fn note(&self, line: &str);

    /// Something that may be wrong.
    fn warn(&self, line: &str);

    /// Whether nobody wants to see progress.
    fn is_quiet(&self) -> bool;
}
