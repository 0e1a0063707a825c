//! How much memory jobs may have together: what the machine and its control groups leave.

use std::fs;
use std::path::{Path, PathBuf};

/// Bytes that new processes can have: what the kernel calls available, or less where a control
/// group of this process has a limit. `None` where the system does not tell.
pub fn available() -> Option<u64> {
    available_under(Path::new("/"))
}

fn available_under(root: &Path) -> Option<u64> {
    let of_groups = own_groups(root).into_iter().filter_map(|group| left_in(&group));
    of_groups.chain(mem_available(root)).min()
}

fn mem_available(root: &Path) -> Option<u64> {
    let text = fs::read_to_string(root.join("proc/meminfo")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    Some(1024 * line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()?)
}

/// The control groups for memory that this process is in, the innermost first, of both versions.
///
/// A container may see its own group as the root of the tree, under another path than it is told.
pub fn own_groups(root: &Path) -> Vec<PathBuf> {
    let told = fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
    let tree = root.join("sys/fs/cgroup");
    let mut groups = Vec::new();
    for line in told.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let bases = match controllers {
            "" => vec![tree.clone(), tree.join("unified")],
            _ if controllers.split(',').any(|one| one == "memory") => vec![tree.join("memory")],
            _ => continue,
        };
        for base in bases {
            let within = Path::new(path.trim_start_matches('/'));
            groups.extend(within.ancestors().map(|within| base.join(within)));
        }
    }
    groups.retain(|group| group.is_dir());
    groups
}

/// What a group's limit leaves; files that are only cached are given up when memory is short.
fn left_in(group: &Path) -> Option<u64> {
    let number = |name: &str| fs::read_to_string(group.join(name)).ok()?.trim().parse().ok();
    let [limit, used] =
        [["memory.max", "memory.current"], ["memory.limit_in_bytes", "memory.usage_in_bytes"]]
            .into_iter()
            .find_map(|[limit, used]| Some([number(limit)?, number(used)?]))?;
    let cached = ["inactive_file ", "total_inactive_file "].into_iter();
    let stat = fs::read_to_string(group.join("memory.stat")).unwrap_or_default();
    let cached: Option<u64> = cached
        .filter_map(|name| stat.lines().find_map(|line| line.strip_prefix(name)?.parse().ok()))
        .next_back();
    Some(u64::saturating_sub(limit, u64::saturating_sub(used, cached.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, path: &str, text: &str) {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn the_tightest_of_machine_and_groups_counts() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        assert_eq!(available_under(root), None);
        write(root, "proc/meminfo", "MemTotal: 9000 kB\nMemAvailable:    8000 kB\n");
        assert_eq!(available_under(root), Some(8000 * 1024));
        write(root, "proc/self/cgroup", "4:memory:/job/step\n0::/user/app\n");
        write(root, "sys/fs/cgroup/user/memory.max", "5000000\n");
        write(root, "sys/fs/cgroup/user/memory.current", "3000000\n");
        write(root, "sys/fs/cgroup/user/memory.stat", "anon 5\ninactive_file 1000000\n");
        write(root, "sys/fs/cgroup/user/app/memory.max", "max\n");
        assert_eq!(available_under(root), Some(3_000_000));
        write(root, "sys/fs/cgroup/memory/job/memory.limit_in_bytes", "4000000\n");
        write(root, "sys/fs/cgroup/memory/job/memory.usage_in_bytes", "3500000\n");
        let stat = "inactive_file 1\ntotal_inactive_file 500000\n";
        write(root, "sys/fs/cgroup/memory/job/memory.stat", stat);
        assert_eq!(available_under(root), Some(1_000_000));
    }
}
