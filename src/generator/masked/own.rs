//! What a run says of a generator of this kind.

use crate::plan::RunSpec;
use crate::spec::{GeneratorSpec, MaskedSpec};

/// The description of a run's generator, which is of this kind.
pub fn own(spec: &RunSpec) -> &MaskedSpec {
    match &spec.generator {
        GeneratorSpec::Masked(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}
