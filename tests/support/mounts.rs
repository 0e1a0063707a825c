//! File systems that are small or read-only, where this machine lets a test mount them.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A mount of a test's own, taken away with the value.
pub struct Mounted(PathBuf);

impl Mounted {
    /// A file system in memory that holds this many KiB; `None` if mounting is not permitted,
    /// which is said aloud.
    pub fn small(place: &Path, kib: usize) -> Option<Self> {
        std::fs::create_dir_all(place).expect("a writable directory");
        let size = format!("size={kib}k");
        let mounted = succeeds(&["mount", "-t", "tmpfs", "-o", &size, "isoflop-test"], place);
        Self::unless_refused(place, mounted)
    }

    /// A folder seen through a mount that may not be written to.
    pub fn read_only(place: &Path) -> Option<Self> {
        let bound = succeeds(&["mount", "--bind", &place.display().to_string()], place);
        let mounted = Self::unless_refused(place, bound)?;
        assert!(
            succeeds(&["mount", "-o", "remount,bind,ro"], place),
            "a bind mount is made read-only"
        );
        Some(mounted)
    }

    fn unless_refused(place: &Path, mounted: bool) -> Option<Self> {
        if mounted {
            println!("ran on a real mount at {}", place.display());
            return Some(Self(place.to_path_buf()));
        }
        println!("NOT RUN ON A REAL MOUNT: this machine does not let tests mount");
        None
    }
}

impl Drop for Mounted {
    fn drop(&mut self) {
        if !succeeds(&["umount"], &self.0) {
            succeeds(&["umount", "--lazy"], &self.0);
        }
    }
}

fn succeeds(words: &[&str], place: &Path) -> bool {
    let output = Command::new(words[0]).args(&words[1..]).arg(place).output();
    output.is_ok_and(|output| output.status.success())
}
