//! Stands in for the crate cubecl-llvm 0.11.3, so that `--features cuda` builds from the registry alone.
//!
//! The crate cubecl-cuda has two compilers of kernels: C++ through NVRTC (its feature `cpp`, which isoflop's `cuda` turns
//! on), and LLVM through cubecl-llvm. It imports the second even if only the first is used, and cubecl-llvm's build
//! script downloads LLVM from GitHub. Here are the names that cubecl-cuda imports, and no compiler: a module of PTX can
//! never be made, and whoever asks for one gets an error or a panic that says how to mend it.
//!
//! `[patch.crates-io]` in the workspace's Cargo.toml puts it in the place of the original. It can go once cubecl-cuda makes
//! cubecl-llvm optional, or once cubecl-llvm builds from the registry alone. It must go along with the versions: after an
//! update of burn, compare it with the imports in cubecl-cuda's `compiler.rs`, `runtime.rs` and `compute/context.rs`.
#![warn(missing_docs)]

#[cfg(not(feature = "nvptx"))]
compile_error!(
    "burn's `cpu` needs the real cubecl-llvm: take [patch.crates-io] out of isoflop's Cargo.toml"
);
#[cfg(feature = "amdgpu")]
compile_error!(
    "burn's `rocm` needs the real cubecl-llvm: take [patch.crates-io] out of isoflop's Cargo.toml"
);

use std::convert::Infallible;

use cubecl_core::CompilationError;
use cubecl_core::environment::backtrace::BackTrace;
use cubecl_core::ir::attributes::BufferIOAttr;
use cubecl_core::ir::nvidia::SmArch;
use cubecl_core::prelude::KernelDefinition;

use nvptx::ptx_version::PtxVersion;

/// How the compiler that is missing can be had, or done without.
const NO_LLVM: &str = "this build has no LLVM: turn on the feature `cpp` of cubecl-cuda, or take \
                       [patch.crates-io] out of isoflop's Cargo.toml and build where GitHub is in reach";

/// What the original compiles for.
#[derive(Clone, Copy, Debug)]
pub enum LlvmTarget {
    /// PTX, for NVIDIA's driver.
    Nvptx,
}

/// The original's compiler; this one refuses every kernel.
#[derive(Clone, Debug)]
pub struct PlironCompiler {
    /// What it would compile for.
    pub target: LlvmTarget,
}

impl PlironCompiler {
    /// Refuses a kernel.
    ///
    /// # Errors
    ///
    /// Always [`CompilationError::Generic`].
    pub fn compile(
        &mut self,
        _: KernelDefinition,
        _: &PlironOptions,
    ) -> Result<PlironArtifact, CompilationError> {
        let (reason, backtrace) = (NO_LLVM.to_string(), BackTrace::capture());
        Err(CompilationError::Generic { reason, backtrace })
    }

    /// The language of its output.
    pub fn lang_tag(&self) -> &'static str {
        "llvm"
    }
}

/// Options of [`PlironCompiler::compile`]; none is read.
#[derive(Clone, Debug, Default)]
pub struct PlironOptions {
    /// An AMD GPU, of which this crate knows none.
    pub arch: Option<Infallible>,
    /// The NVIDIA GPU.
    pub sm_arch: Option<SmArch>,
    /// The version of PTX.
    pub ptx_version: Option<PtxVersion>,
    /// Whether scalars are passed by value.
    pub grid_constants: bool,
}

/// The result of a compilation; there is none.
#[derive(Clone, Debug)]
pub enum PlironArtifact {
    /// PTX.
    NvptxCode(NvptxModule),
}

/// A module of PTX, which cannot be made.
#[derive(Clone, Debug)]
pub struct NvptxModule {
    /// Its code, ended by NUL.
    pub ptx: Vec<core::ffi::c_char>,
    /// Its code before PTX.
    pub ir: String,
    /// Bytes of shared memory a launch.
    pub shared_memory_size: usize,
    /// What it does with each buffer.
    pub io: Vec<BufferIOAttr>,
    /// No value.
    pub never: Infallible,
}

/// The original's module of this name.
pub mod nvptx {
    /// The original's module of this name.
    pub mod ptx_version {
        /// A version of PTX; there is none.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum PtxVersion {}

        impl PtxVersion {
            /// `None`: the version matters to LLVM alone.
            pub fn for_driver(_: i32) -> Option<Self> {
                None
            }
        }

        impl core::fmt::Display for PtxVersion {
            fn fmt(&self, _: &mut core::fmt::Formatter) -> core::fmt::Result {
                match *self {}
            }
        }
    }
}

/// The original's module of this name.
pub mod shared {
    /// The original's module of this name.
    pub mod lowered_features {
        use cubecl_core::ir::DeviceProperties;

        /// The GPUs that LLVM compiles for.
        #[derive(Clone, Copy, Debug)]
        pub enum GpuTarget {
            /// NVIDIA's.
            Nvptx,
        }

        /// Narrows a device's features to those that LLVM compiles; called only if LLVM was chosen.
        ///
        /// # Panics
        ///
        /// Always.
        pub fn restrict_features(_: &mut DeviceProperties, _: GpuTarget) {
            panic!("{}", crate::NO_LLVM);
        }
    }
}
