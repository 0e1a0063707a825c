//! Laws that hold nothing yet.

use crate::laws::file::judgement::Judgement;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::lines::types::{LossLaws, PowerLaws};

/// The laws of a table before anything was fitted, around C0 = `reference_flops`; the budgets they
/// speak of are the least and the greatest that the table holds.
pub(in crate::laws) fn unfitted(
    law: LawKind,
    (name, flops_rule): (&str, &str),
    parameters: Parameters,
    reference_flops: f64,
    points: &[IsoFlopPoint],
) -> Laws {
    let flops = || points.iter().map(|p| p.flops);
    let (least, most) = (flops().fold(f64::INFINITY, f64::min), flops().fold(0.0, f64::max));
    Laws {
        name: name.to_string(),
        law,
        from_sweep: false,
        flops_rule: flops_rule.to_string(),
        metric: points.first().map(|point| point.metric.clone()).unwrap_or_default(),
        parameters,
        n_ctx: None,
        head_share: None,
        own_vocabularies: false,
        reference_flops,
        fitted_budgets: if least < most { vec![least, most] } else { vec![most] },
        minima_method: MinimumMethod::Argmin,
        minima: Vec::new(),
        held_out: None,
        power_laws: PowerLaws::default(),
        vocab_from_nonvocab: None,
        loss: LossLaws::default(),
        parametric: None,
        sensitivity: Vec::new(),
        noise: None,
        validation: Vec::new(),
        advice: Vec::new(),
        bootstrap: Vec::new(),
        warnings: Vec::new(),
        judgement: Judgement::default(),
        answer: None,
    }
}
