//! What this machine and this process have of memory.

pub mod allocator;
pub mod memory;
pub mod oom;
pub mod peak;
