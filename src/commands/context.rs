//! What several commands begin with: the sweep, its data, its plan and its folder.

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use isoflop::data::{self, DataFacts};
use isoflop::plan::{Plan, longest_run};
use isoflop::record::ResultsFolder;
use isoflop::sweep::{self, Clips, DataSource, Sweep};

use super::args::{DeviceName, SweepArgs};

/// A sweep and its plan over its data.
pub struct OpenSweep {
    /// As resolved: `clips: auto` is a number here.
    pub sweep: Sweep,
    pub plan: Plan,
    pub folder: ResultsFolder,
}

/// Reads a sweep file and names its folder.
pub fn read_sweep(args: &SweepArgs) -> Result<(Sweep, ResultsFolder)> {
    let sweep = sweep::read(&args.sweep, &args.settings)?;
    let folder = ResultsFolder::new(args.out.join(&sweep.name));
    Ok((sweep, folder))
}

/// Reads a sweep file, opens its data and plans it.
pub fn open_sweep(args: &SweepArgs) -> Result<OpenSweep> {
    let (mut sweep, folder) = read_sweep(args)?;
    let source = data::open(&sweep.data, longest_run(&sweep)).context("opening the data")?;
    if sweep.data.source == DataSource::Procedural {
        sweep.data.clips = Clips::Count(source.n_clips(data::Split::Train));
    }
    let plan = Plan::new(&sweep, DataFacts::of(&*source));
    Ok(OpenSweep { sweep, plan, folder })
}

/// The plan of a sweep whose data may not be here: then ids are provisional, and it says so.
pub fn plan_sweep(args: &SweepArgs) -> Result<(Plan, ResultsFolder)> {
    let (sweep, folder) = read_sweep(args)?;
    let facts = match data::open(&sweep.data, longest_run(&sweep)) {
        Ok(source) => DataFacts::of(&*source),
        Err(error) => DataFacts::absent(format!("the data could not be opened: {error}")),
    };
    Ok((Plan::new(&sweep, facts), folder))
}

/// The device of a name, where this build has it.
pub fn device(name: DeviceName) -> Result<Device> {
    match name {
        DeviceName::Flex => Ok(Device::flex()),
        #[allow(deprecated)]
        DeviceName::Ndarray => Ok(Device::ndarray()),
        #[cfg(feature = "wgpu")]
        DeviceName::Wgpu => Ok(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
        #[cfg(feature = "vulkan")]
        DeviceName::Vulkan => Ok(Device::vulkan(burn::tensor::DeviceKind::DefaultDevice)),
        #[cfg(feature = "cuda")]
        DeviceName::Cuda => Ok(Device::cuda(0)),
        #[cfg(not(all(feature = "wgpu", feature = "vulkan", feature = "cuda")))]
        missing => bail!(
            "this build has no {0} device; build it with `cargo build --release --features {0}`",
            missing.name()
        ),
    }
}
