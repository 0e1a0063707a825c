//! [`Allocator`]: mimalloc, and an exit code of its own for a process that dies of a refusal.

use std::alloc::{GlobalAlloc, Layout};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};

use mimalloc::MiMalloc;
use nix::libc;
use nix::sys::signal::{SigHandler, Signal, signal};

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

/// From here on, a process that aborts after a refusal exits with `code`; its parent then knows why.
///
/// Rust's runtime says how many bytes were refused, and aborts: a signal, which a fault of the
/// program gives too.
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
