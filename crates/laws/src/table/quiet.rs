//! A panic of the Parquet reader without its message: it is caught, and told as an error.

use std::cell::Cell;
use std::panic::{PanicHookInfo, UnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! {
    /// Whether this thread reads.
    static READS: Cell<bool> = const { Cell::new(false) };
}

/// Threads that read.
static READERS: AtomicUsize = AtomicUsize::new(0);

/// What `read` gives; `None` where it panics, of which nothing is printed.
///
/// The hook is one for the whole process. It keeps quiet about panics of the threads that read, and while one
/// reads about those that begin in polars, whose own threads help; all others it hands on.
pub fn quietly<T>(read: impl FnOnce() -> T + UnwindSafe) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |info| {
            if !is_readers(info) {
                others(info);
            }
        }));
    });
    READS.set(true);
    READERS.fetch_add(1, Ordering::SeqCst);
    let read = catch_unwind(read);
    READERS.fetch_sub(1, Ordering::SeqCst);
    READS.set(false);
    read.ok()
}

fn is_readers(info: &PanicHookInfo) -> bool {
    let in_polars = info.location().is_some_and(|place| place.file().contains("polars"));
    READS.get() || in_polars && READERS.load(Ordering::SeqCst) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_none_and_a_value_itself() {
        assert_eq!(quietly(|| 7), Some(7));
        let nothing: Option<u8> = quietly(|| panic!("this is not printed"));
        assert_eq!(nothing, None);
        assert!(!READS.get());
    }
}
