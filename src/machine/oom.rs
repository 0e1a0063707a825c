//! [`Kills`]: how many processes the system has killed because it was out of memory.

use std::fs;
use std::path::{Path, PathBuf};

use crate::machine::memory::own_groups;

/// Counts of kills for memory: of the machine, and of each control group that this process is in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kills(Vec<(PathBuf, u64)>);

impl Kills {
    /// The counts now; nothing where the system shows none.
    pub fn so_far() -> Self {
        let events = ["memory.events", "memory.oom_control"];
        let groups = own_groups(Path::new("/"));
        let files = groups.iter().flat_map(|group| events.map(|name| group.join(name)));
        let files = files.chain([PathBuf::from("/proc/vmstat")]);
        Self(files.filter_map(|path| Some((path.clone(), kills(&path)?))).collect())
    }

    /// Whether any has risen since.
    pub fn have_risen(&self) -> bool {
        self.0.iter().any(|(path, before)| kills(path).is_some_and(|now| now > *before))
    }
}

/// The number after `oom_kill` in a file of names and numbers.
fn kills(path: &Path) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    text.lines().find_map(|line| line.strip_prefix("oom_kill ")?.trim().parse().ok())
}
