//! [`DeviceName`]: a device that burn can compute on, by the name on the command line.

use std::str::FromStr;

use burn::tensor::Device;

/// A device that burn can compute on.
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
    /// Every device with what it is, the default first.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::Flex, "burn-flex: this processor"),
        (Self::Ndarray, "burn-ndarray: this processor, slower; deprecated by burn"),
        (Self::Wgpu, "A GPU through Vulkan, Metal or DirectX; needs a build with --features wgpu"),
        (
            Self::Vulkan,
            "A GPU through Vulkan, with kernels in SPIR-V; needs a build with --features vulkan",
        ),
        (Self::Cuda, "An NVIDIA GPU; needs a build with --features cuda"),
    ];

    /// The name as it is typed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
            Self::Wgpu => "wgpu",
            Self::Vulkan => "vulkan",
            Self::Cuda => "cuda",
        }
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
        let found = Self::ALL.into_iter().map(|(device, _)| device).find(|d| d.name() == name);
        found.ok_or_else(|| format!("no device is named `{name}`"))
    }
}
