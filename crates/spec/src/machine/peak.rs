//! How much memory a worker took.

/// The most memory that this process had to itself, in bytes; 0 where the system does not tell.
///
/// Files that it maps are left out: the processes beside it share them, and the kernel drops their
/// pages when memory is short.
#[cfg(target_os = "linux")]
pub fn peak_bytes() -> u64 {
    own_peak(&std::fs::read_to_string("/proc/self/status").unwrap_or_default())
}

/// Unknown here: systems count it in different units.
#[cfg(not(target_os = "linux"))]
pub fn peak_bytes() -> u64 {
    0
}

/// From the kernel's high-water mark, which counts mapped files too: those are at their most at the
/// end. (`getrusage` would give the scheduler's mark where that is larger, since it outlives the start
/// of another program.)
#[cfg(target_os = "linux")]
fn own_peak(status: &str) -> u64 {
    let bytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name));
        let kibibytes =
            line.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse().ok());
        kibibytes.map_or(0, |n: u64| n * 1024)
    };
    let shared = bytes("RssFile:") + bytes("RssShmem:");
    bytes("VmHWM:").saturating_sub(shared).max(bytes("RssAnon:"))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn mapped_files_are_not_a_workers_own() {
        let status = "VmHWM:\t  900 kB\nRssAnon:\t 300 kB\nRssFile:\t 200 kB\nRssShmem:\t 0 kB\n";
        assert_eq!(own_peak(status), 700 * 1024);
        assert_eq!(own_peak("VmHWM: 9 kB\nRssAnon: 8 kB\nRssFile: 4 kB\n"), 8 * 1024);
        assert_eq!(own_peak(""), 0);
    }

    #[test]
    fn memory_that_is_given_back_stays_in_the_peak() {
        let before = peak_bytes();
        let n = before as usize + (1 << 24);
        assert!(std::hint::black_box(vec![1u8; n]).iter().all(|byte| *byte == 1));
        assert!(peak_bytes() as usize >= n);
    }
}
