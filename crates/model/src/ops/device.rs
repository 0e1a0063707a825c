//! [`DeviceName`]: a device that burn can compute on, by the name on the command line.

use std::str::FromStr;

use burn::tensor::Device;

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

/// This build does not have the device.
#[derive(Debug, thiserror::Error)]
#[error("this build has no {0} device; build it with `cargo build --release --features {0}`")]
pub struct NoDevice(&'static str);

impl DeviceName {
    /// Every device with its name as it is typed and what it is, the default first.
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
    /// This build does not have it.
    pub fn open(self) -> Result<Device, NoDevice> {
        match self {
            Self::Flex => Ok(Device::flex()),
            #[expect(deprecated, reason = "a check of our own kernels, as long as burn has it")]
            Self::Ndarray => Ok(Device::ndarray()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => Ok(Device::vulkan(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(feature = "cuda")]
            Self::Cuda => Ok(Device::cuda(0)),
            #[cfg(not(all(feature = "wgpu", feature = "vulkan", feature = "cuda")))]
            missing => Err(NoDevice(missing.name())),
        }
    }
}

impl FromStr for DeviceName {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|(_, own, _)| *own == name);
        found.map(|(device, ..)| device).ok_or_else(|| format!("no device is named `{name}`"))
    }
}
