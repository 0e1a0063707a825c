//! The choice of vectors: a kernel is written once, generic over [`Lanes`](super::lanes::Lanes). [`vectorised!`] compiles
//! it for AVX-512, for AVX2 and for the build's own target, and picks one at run time.

#[cfg(not(target_arch = "x86_64"))]
use super::lanes::VECTORS;
#[cfg(target_arch = "x86_64")]
use super::x86::Isa;

/// The name of the vectors that kernels use, by the processor and `ISOFLOP_VECTORS`.
///
/// # Errors
/// `ISOFLOP_VECTORS` names no vectors of this processor.
pub fn vectors() -> Result<&'static str, String> {
    #[cfg(target_arch = "x86_64")]
    return Isa::asked().map(Isa::name);
    #[cfg(not(target_arch = "x86_64"))]
    match std::env::var_os(VECTORS) {
        Some(asked) if asked != "portable" => {
            Err(format!("{VECTORS} is `{}`; on this processor it may be portable", asked.display()))
        }
        _ => Ok("portable"),
    }
}

/// Compiles a kernel for each kind of vector and picks one at run time.
///
/// The body is generic over a type `L` of [`Lanes`](super::lanes::Lanes). Functions that it calls must be
/// `#[inline(always)]`; otherwise they are compiled for the build's own target and are slow.
macro_rules! vectorised {
    (
        $(#[$meta:meta])*
        $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block
    ) => {
        $(#[$meta])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body<L: $crate::ops::own::lanes::Lanes>($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                use $crate::ops::own::x86::{Isa, Pair, Wide};

                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
                fn wide($($arg: $ty),*) $(-> $ret)? {
                    body::<Wide>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn pair($($arg: $ty),*) $(-> $ret)? {
                    body::<Pair>($($arg),*)
                }
                match Isa::of_this_machine() {
                    // SAFETY: the processor has just said that it has these instructions.
                    Isa::Avx512 => return unsafe { wide($($arg),*) },
                    // SAFETY: as above.
                    Isa::Avx2 => return unsafe { pair($($arg),*) },
                    Isa::Baseline => {}
                }
            }
            body::<[f32; $crate::ops::own::lanes::LANES]>($($arg),*)
        }
    };
}
pub(super) use vectorised;
