//! Memory of this machine and this process; GPUs by name.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::machine::{available, peak_bytes};
//!
//! let free = available().unwrap_or(u64::MAX);
//! assert!(free > 0 && peak_bytes() > 0);
//! ```

use std::alloc::{GlobalAlloc, Layout};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use mimalloc::MiMalloc;
use nix::libc;
use nix::sys::signal::{SigHandler, Signal, signal};

// [`Allocator`]: mimalloc, with a distinct exit code for a process that aborts on a refused allocation.

/// mimalloc, which notes that the system refused memory.
pub struct Allocator;

/// Whether an allocation was refused.
static REFUSED: AtomicBool = AtomicBool::new(false);
/// The exit code of a process that aborts since it was refused memory.
static EXIT_CODE: AtomicI32 = AtomicI32::new(0);

// SAFETY: each call is mimalloc's own, with the caller's arguments.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        noted(unsafe { MiMalloc.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc_zeroed`.
        noted(unsafe { MiMalloc.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::realloc`.
        noted(unsafe { MiMalloc.realloc(pointer, layout, size) })
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::dealloc`.
        unsafe { MiMalloc.dealloc(pointer, layout) }
    }
}

fn noted(pointer: *mut u8) -> *mut u8 {
    if pointer.is_null() {
        REFUSED.store(true, Ordering::Relaxed);
    }
    pointer
}

/// Makes the process exit with `code` if it aborts after a refused allocation, so its parent knows why.
///
/// Rust's runtime prints the number of bytes and aborts with a signal, like a crash.
pub fn exit_when_refused(code: i32) {
    EXIT_CODE.store(code, Ordering::Relaxed);
    // SAFETY: the handler reads atomics and calls `_exit`; both are safe in a signal handler.
    let _ = unsafe { signal(Signal::SIGABRT, SigHandler::Handler(on_abort)) };
}

extern "C" fn on_abort(_: libc::c_int) {
    if REFUSED.load(Ordering::Relaxed) {
        // SAFETY: `_exit` ends the process and runs nothing of it.
        unsafe { libc::_exit(EXIT_CODE.load(Ordering::Relaxed)) }
    }
    // SAFETY: both are safe in a signal handler; the signal comes again when the handler returns.
    unsafe {
        libc::signal(libc::SIGABRT, libc::SIG_DFL);
        libc::raise(libc::SIGABRT);
    }
}

// A file that is mapped, and cut short by another program: to read beyond its new end is a bus error.

const CUT: &str = "error: a file that is mapped into memory was cut short while it was read\n";

/// From here on, a process that dies of a bus error says why first.
pub fn tell_of_cut_files() {
    // SAFETY: the handler calls `write` and `signal`; both are safe in a signal handler.
    let _ = unsafe { signal(Signal::SIGBUS, SigHandler::Handler(on_bus_error)) };
}

extern "C" fn on_bus_error(_: libc::c_int) {
    // SAFETY: both are safe in a signal handler; the fault comes again when the handler returns, and ends the process.
    unsafe {
        libc::write(libc::STDERR_FILENO, CUT.as_ptr().cast(), CUT.len());
        libc::signal(libc::SIGBUS, libc::SIG_DFL);
    }
}

// [`Kills`]: how many processes the system has killed because it was out of memory.

/// Counts of kills for memory: of the machine, and of each control group that this process is in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kills(Vec<(PathBuf, u64)>);

impl Kills {
    /// The counts now; nothing if the system shows none.
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

// Memory available to all jobs: limited by the machine and its control groups.

/// Bytes available to new processes: the kernel's estimate, or less under the limit of a control group. `None` if
/// unknown.
pub fn available() -> Option<u64> {
    available_under(Path::new("/"))
}

fn available_under(root: &Path) -> Option<u64> {
    let of_groups = own_groups(root).into_iter().filter_map(|group| left_in(&group));
    of_groups.chain(mem_available(root)).min()
}

fn mem_available(root: &Path) -> Option<u64> {
    kibibytes(&fs::read_to_string(root.join("proc/meminfo")).ok()?, "MemAvailable:")
}

/// Bytes, as the kernel writes them: `MemAvailable:    8000 kB`.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(1024 * line.trim().trim_end_matches("kB").trim().parse::<u64>().ok()?)
}

/// The memory control groups of this process, the innermost first, of both versions.
///
/// A container may see its group as the root of the tree, under another path than reported.
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

/// Bytes left under a group's limit; cached files count as free.
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

// Memory used by a worker.

/// Peak private memory of this process, in bytes; 0 if unknown.
///
/// Mapped files are left out: other processes share them, and the kernel drops their pages when memory is short.
#[cfg(target_os = "linux")]
pub fn peak_bytes() -> u64 {
    own_peak(&fs::read_to_string("/proc/self/status").unwrap_or_default())
}

/// Unknown here: systems count it in different units.
#[cfg(not(target_os = "linux"))]
pub fn peak_bytes() -> u64 {
    0
}

/// From the kernel's high-water mark minus mapped files, whose size is largest at the end. (`getrusage` would give
/// the scheduler's mark if that is larger, since it survives the start of another program.)
#[cfg(target_os = "linux")]
fn own_peak(status: &str) -> u64 {
    let bytes = |name: &str| kibibytes(status, name).unwrap_or(0);
    let shared = bytes("RssFile:") + bytes("RssShmem:");
    bytes("VmHWM:").saturating_sub(shared).max(bytes("RssAnon:"))
}

// [`Card`]: a GPU by name, with the numbers of its data sheet.

/// A GPU.
#[derive(Debug, PartialEq)]
pub struct Card {
    /// The name in a sweep and on the command line.
    pub name: &'static str,
    /// The word by which the driver's name of the device is known: `H100` in `NVIDIA H100 80GB HBM3`.
    pub word: &'static str,
    /// Peak of dense bf16 products that are summed in f32, FLOP/s.
    pub peak_flops: f64,
    /// Memory, bytes.
    pub memory_bytes: f64,
    /// Bandwidth of the memory, bytes/s.
    pub bytes_per_s: f64,
}

impl Card {
    /// Whether a device of this name is this card, whatever the memory of an A100.
    pub fn is_named(&self, device: &str) -> bool {
        device.split(|c: char| !c.is_ascii_alphanumeric()).any(|word| word == self.word)
    }
}

/// The cards that are known.
///
/// From the vendors' data sheets, without sparsity: NVIDIA A100 (SXM), H100 (SXM), H200 (SXM), L4 and L40S
/// data sheets; the Ada and GA102 whitepapers for the RTX 4090 and 3090; AMD Instinct MI300X data sheet.
pub static CARDS: [Card; 10] = [
    card("a100", "A100", [312e12, 80e9, 2.039e12]),
    card("a100-40", "A100", [312e12, 40e9, 1.555e12]),
    card("a100-80", "A100", [312e12, 80e9, 2.039e12]),
    card("h100", "H100", [989e12, 80e9, 3.35e12]),
    card("h200", "H200", [989e12, 141e9, 4.8e12]),
    card("l4", "L4", [121e12, 24e9, 0.3e12]),
    card("l40s", "L40S", [362e12, 48e9, 0.864e12]),
    card("rtx3090", "3090", [71e12, 24e9, 0.936e12]),
    card("rtx4090", "4090", [165e12, 24e9, 1.008e12]),
    card("mi300x", "MI300X", [1307e12, 192e9, 5.3e12]),
];

const fn card(name: &'static str, word: &'static str, numbers: [f64; 3]) -> Card {
    let [peak_flops, memory_bytes, bytes_per_s] = numbers;
    Card { name, word, peak_flops, memory_bytes, bytes_per_s }
}

/// The card of a name; `None` if it is not known.
pub fn find(name: &str) -> Option<&'static Card> {
    CARDS.iter().find(|card| card.name == name)
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

    #[test]
    fn a_card_is_known_by_the_drivers_name() {
        let named = |name: &str, device| find(name).is_some_and(|card| card.is_named(device));
        assert!(named("h100", "NVIDIA H100 80GB HBM3") && named("l4", "NVIDIA L4"));
        assert!(named("a100-40", "NVIDIA A100-SXM4-40GB"));
        assert!(named("rtx4090", "NVIDIA GeForce RTX 4090"));
        assert!(!named("l4", "NVIDIA L40S") && !named("h100", "NVIDIA H200"));
        assert!(!named("h100", "torch cpu") && !named("h100", "custom"));
        assert_eq!(find("h1000"), None);
    }

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
