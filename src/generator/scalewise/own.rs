//! What a run says of a generator of this kind.

use crate::plan::RunSpec;
use crate::spec::{GeneratorSpec, ScalewiseSpec};

/// The description of a run's generator, which is of this kind.
pub fn own(spec: &RunSpec) -> &ScalewiseSpec {
    match &spec.generator {
        GeneratorSpec::Scalewise(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}
