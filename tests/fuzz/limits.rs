//! What reading one input may take: memory, time, and no panic.

use std::alloc::{GlobalAlloc, Layout};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use isoflop::machine::Allocator;
use nix::sys::resource::{UsageWho, getrusage};

/// Time of all processors; a machine that does other work beside it slows no input down.
pub const MOST_TIME: Duration = Duration::from_secs(2);
/// Bytes at once, beside those that were there before.
pub const MOST_BYTES: usize = 500 << 20;

// Memory: the program's allocator, counted.

/// The program's allocator; counts the bytes that are taken, and refuses what no reader may ask for.
pub struct Counted;

/// Bytes beyond which an allocation is refused, so that the machine lives: many times [`MOST_BYTES`].
const REFUSED: usize = 6 << 30;

static TAKEN: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: each call is the program's allocator's own, with the caller's arguments, or gives a null.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`.
        taken(layout.size(), || unsafe { Allocator.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc_zeroed`.
        taken(layout.size(), || unsafe { Allocator.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc::realloc`.
        let new = taken(size, || unsafe { Allocator.realloc(pointer, layout, size) });
        if !new.is_null() {
            TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        }
        new
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `GlobalAlloc::dealloc`.
        unsafe { Allocator.dealloc(pointer, layout) }
    }
}

/// What `take` gives, counted.
fn taken(size: usize, take: impl FnOnce() -> *mut u8) -> *mut u8 {
    let all = TAKEN.fetch_add(size, Ordering::Relaxed).saturating_add(size);
    PEAK.fetch_max(all, Ordering::Relaxed);
    let pointer = if all > REFUSED { std::ptr::null_mut() } else { take() };
    if pointer.is_null() {
        TAKEN.fetch_sub(size, Ordering::Relaxed);
    }
    pointer
}

// One input: what it took, and what was said of it.

/// What reading an input took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Took {
    pub seconds: f64,
    pub bytes: usize,
}

/// Messages of panics on any thread while an input is read.
static PANICS: Mutex<Vec<String>> = Mutex::new(Vec::new());
static READING: AtomicBool = AtomicBool::new(false);

/// Whether an input is being read.
pub fn is_reading() -> bool {
    READING.load(Ordering::Relaxed)
}

/// Reads an input within the limits: what it took and what the reader said, or how it failed.
pub fn limited(
    read: impl FnOnce() -> Result<(), String>,
) -> (Took, Result<Result<(), String>, String>) {
    let (before, since) = (TAKEN.load(Ordering::Relaxed), processor_s());
    PEAK.store(before, Ordering::Relaxed);
    READING.store(true, Ordering::Relaxed);
    let said = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read));
    READING.store(false, Ordering::Relaxed);
    let bytes = PEAK.load(Ordering::Relaxed).saturating_sub(before);
    let took = Took { seconds: processor_s() - since, bytes };
    let panics = std::mem::take(&mut *PANICS.lock().unwrap_or_else(|held| held.into_inner()));
    let problem = match (panics.first(), &said) {
        (Some(panic), _) => Some(panic.clone()),
        (None, Err(_)) => Some("it panics without a word".to_string()),
        _ if bytes > MOST_BYTES => Some(format!("it takes {} MB", bytes >> 20)),
        _ if took.seconds > MOST_TIME.as_secs_f64() => {
            Some(format!("it takes {:.1} s", took.seconds))
        }
        (None, Ok(Err(sentence))) => no_sentence(sentence),
        (None, Ok(Ok(()))) => None,
    };
    (took, problem.map_or_else(|| Ok(said.unwrap_or(Ok(()))), Err))
}

/// Seconds of all processors that this process took.
fn processor_s() -> f64 {
    getrusage(UsageWho::RUSAGE_SELF).map_or(0.0, |usage| {
        let (own, of_system) = (usage.user_time(), usage.system_time());
        let microseconds = own.tv_usec() + of_system.tv_usec();
        (own.tv_sec() + of_system.tv_sec()) as f64 + microseconds as f64 * 1e-6
    })
}

/// From here on, a panic while an input is read is kept and not printed. It is called before any reader is: that of
/// Parquet keeps the panics of polars, which it catches, to itself.
pub fn hold_panics() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let printed = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if is_reading() {
                let mut held = PANICS.lock().unwrap_or_else(|held| held.into_inner());
                held.push(panic.to_string());
            } else {
                printed(panic);
            }
        }));
    });
}

/// Why the words of an error are no sentence for a person. The program cuts long ones and takes out what is not
/// for a terminal.
fn no_sentence(words: &str) -> Option<String> {
    match words {
        _ if words.trim().is_empty() => Some("its error is empty".to_string()),
        _ if words.contains("panicked") => Some(format!("its error tells of a panic: {words}")),
        _ => None,
    }
}
