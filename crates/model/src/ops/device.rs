//! [`DeviceName`]: a device that burn can compute on, by the name on the command line; and whether it multiplies.

use std::str::FromStr;

use burn::tensor::{Device, Tensor, TensorData};

use super::own::vectors;

/// A device that burn can compute on, in the order of [`DeviceName::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// burn-flex: this processor.
    Flex,
    /// burn-ndarray: this processor, slower; deprecated by burn.
    Ndarray,
    /// A GPU through Vulkan, Metal or DirectX; needs a build with `--features wgpu`.
    Wgpu,
    /// A GPU through Vulkan, with kernels in SPIR-V; needs a build with `--features vulkan`.
    Vulkan,
    /// An NVIDIA GPU; needs a build with `--features cuda`.
    Cuda,
}

/// A device that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum NoDevice {
    /// Another build has it.
    #[error("this build has no {0} device; build it with `cargo build --release --features {0}`")]
    NotInBuild(&'static str),
    /// `ISOFLOP_VECTORS` names no vectors of this processor.
    #[error("{0}")]
    Vectors(String),
    /// A part of CUDA is not installed.
    #[error(
        "this machine has no {0}: the device cuda needs NVIDIA's driver and, of a CUDA toolkit, NVRTC and \
         the headers; install the toolkit, and name its folder in CUDA_PATH unless it is /usr/local/cuda"
    )]
    NoCuda(&'static str),
}

impl DeviceName {
    /// Every device with its name and description, the default first.
    pub const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::Flex, "flex", "burn-flex: this processor"),
        (Self::Ndarray, "ndarray", "burn-ndarray: this processor, slower; deprecated by burn"),
        (
            Self::Wgpu,
            "wgpu",
            "A GPU through Vulkan, Metal or DirectX; needs a build with --features wgpu",
        ),
        (
            Self::Vulkan,
            "vulkan",
            "A GPU through Vulkan, with kernels in SPIR-V; needs a build with --features vulkan",
        ),
        (Self::Cuda, "cuda", "An NVIDIA GPU; needs a build with --features cuda"),
    ];

    /// The name as it is typed.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// Whether it is this machine's processor, on which jobs are spread over the cores.
    pub fn is_processor(self) -> bool {
        matches!(self, Self::Flex | Self::Ndarray)
    }

    /// The device.
    ///
    /// # Errors
    /// This build does not have it, `ISOFLOP_VECTORS` names no vectors of this processor, or a part of CUDA is missing.
    pub fn open(self) -> Result<Device, NoDevice> {
        match self {
            Self::Flex => vectors().map(|_| Device::flex()).map_err(NoDevice::Vectors),
            #[expect(deprecated, reason = "a check of our own kernels, as long as burn has it")]
            Self::Ndarray => Ok(Device::ndarray()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => Ok(Device::vulkan(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(feature = "cuda")]
            Self::Cuda => cuda(),
            #[cfg(not(all(feature = "wgpu", feature = "vulkan", feature = "cuda")))]
            missing => Err(NoDevice::NotInBuild(missing.name())),
        }
    }
}

/// The first NVIDIA GPU. burn panics if a part of CUDA is missing, so they are looked for first.
#[cfg(feature = "cuda")]
fn cuda() -> Result<Device, NoDevice> {
    // SAFETY: loading the libraries runs their initialisers, which need nothing of this process.
    let (driver, nvrtc) = unsafe {
        (cudarc::driver::sys::is_culib_present(), cudarc::nvrtc::sys::is_culib_present())
    };
    let headers = cubecl_cuda::install::cuda_path().is_some();
    let parts = [(driver, "libcuda"), (nvrtc, "libnvrtc"), (headers, "CUDA toolkit")];
    match parts.into_iter().find(|(is_there, _)| !is_there) {
        Some((_, missing)) => Err(NoDevice::NoCuda(missing)),
        None => Ok(Device::cuda(0)),
    }
}

impl FromStr for DeviceName {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|(_, own, _)| *own == name);
        found.map(|(device, ..)| device).ok_or_else(|| format!("no device is named `{name}`"))
    }
}

// Whether a device multiplies: drivers are met that load every kernel and give zeros.

/// The wrong product of a device.
#[derive(Debug, thiserror::Error)]
#[error(
    "the device multiplies matrices wrongly ({found} where {right} is right): its driver cannot be \
     used; take another device"
)]
pub struct WrongProduct {
    found: f32,
    right: f32,
}

const ROWS: usize = 33;
const INNER: usize = 17;
const COLUMNS: usize = 29;

/// Small whole numbers, of which products and sums are exact in every order.
fn number(i: usize) -> f32 {
    (i * 7 % 11) as f32 - 5.0
}

/// Multiplies two matrices and looks at every element.
///
/// # Errors
/// The first element that is wrong.
pub fn check_products(device: &Device) -> Result<(), WrongProduct> {
    let matrix = |[rows, columns]: [usize; 2]| {
        let values: Vec<f32> = (0..rows * columns).map(number).collect();
        Tensor::<2>::from_data(TensorData::new(values, [rows, columns]), device)
    };
    let found = matrix([ROWS, INNER]).matmul(matrix([INNER, COLUMNS])).into_data();
    first_wrong(found.iter::<f32>()).map_or(Ok(()), Err)
}

fn first_wrong(found: impl Iterator<Item = f32>) -> Option<WrongProduct> {
    let right = (0..ROWS * COLUMNS).map(|i| {
        let (row, column) = (i / COLUMNS, i % COLUMNS);
        let term = |k| number(row * INNER + k) * number(k * COLUMNS + column);
        (0..INNER).map(term).sum::<f32>()
    });
    let wrong = found.zip(right).find(|(found, right)| found != right);
    wrong.map(|(found, right)| WrongProduct { found, right })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_that_multiply_pass_and_zeros_do_not() {
        check_products(&Device::flex()).unwrap();
        #[expect(deprecated, reason = "the only other device that every build has")]
        check_products(&Device::ndarray()).unwrap();
        let error = first_wrong(std::iter::repeat_n(0.0, ROWS * COLUMNS)).unwrap();
        assert!(error.to_string().contains("(0 where"), "{error}");
        let gone = first_wrong(std::iter::repeat_n(f32::NAN, ROWS * COLUMNS));
        assert!(gone.is_some());
    }
}
