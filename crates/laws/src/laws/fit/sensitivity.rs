//! The exponents under other choices, one row a choice.

use crate::laws::file::laws::Laws;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::Parameters;
use crate::laws::lines::law_set::{Columns, law_set};
use crate::laws::lines::types::{PowerLaw, Sensitivity};
use crate::laws::maths::stats::geometric_mean;
use crate::laws::minima;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::select::usable;
use crate::laws::minima::split::Split;
use crate::laws::minima::types::Minimum;

/// The row of laws that were fitted under another convention.
///
/// A table of points carries one FLOP rule, so the rows for other rules come from refits: move the
/// points to equal FLOPs by the other rule ([`slices`](crate::laws::lines::slices::slices())), fit without a bootstrap, and
/// push this row onto [`Laws::sensitivity`] of the main fit.
pub fn sensitivity_row(variant: &str, laws: &Laws) -> Sensitivity {
    let exponent = |law: &Option<PowerLaw>| law.as_ref().map(|law| law.exponent);
    Sensitivity {
        variant: variant.to_string(),
        exponent_vocab: exponent(&laws.power_laws.params_vocab),
        exponent_nonvocab: exponent(&laws.power_laws.params_nonvocab),
        exponent_params: exponent(&laws.power_laws.params),
        exponent_tokens: exponent(&laws.power_laws.tokens),
        slope_per_decade: laws.loss.log.as_ref().map(|law| law.slope_per_decade),
    }
}

/// One row for each kind of minimum, one more with every flagged minimum of `law_method` kept, and one
/// where a model's size is all its parameters. A row's numbers are absent where fewer than two budgets have a usable minimum of that kind.
pub(in crate::laws) fn by_method(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    law_method: MinimumMethod,
    split: &Split,
    options: &FitOptions,
) -> Vec<Sensitivity> {
    let has_vocab_law = split.n_vocabularies() > 1;
    let row = |variant: String, minima: &[Minimum]| {
        let columns = Columns::new(minima, &split.fitted, options);
        numbers(variant, &columns, has_vocab_law, options)
    };
    let mut rows: Vec<_> = per_method
        .iter()
        .map(|(method, minima)| row(format!("minima: {method}"), &usable(minima, options)))
        .collect();
    for (method, minima) in per_method.iter().filter(|(method, _)| *method == law_method) {
        if !options.keep_flagged && minima.iter().any(|m| !m.flags.is_empty()) {
            rows.push(row(format!("minima: {method}, flagged kept"), minima));
        }
    }
    rows.extend(other_methods(per_method, split, options).map(|(m, used)| row(m, &used)));
    rows.extend(size_with_vocabulary(law_method, split, options));
    rows
}

/// Akima's spline and the surface where they were not asked for and two budgets have one.
fn other_methods(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    split: &Split,
    options: &FitOptions,
) -> impl Iterator<Item = (String, Vec<Minimum>)> {
    let asked = |method: &MinimumMethod| per_method.iter().any(|(asked, _)| asked == method);
    let methods = [MinimumMethod::Akima, MinimumMethod::Surface];
    let rows = methods.into_iter().filter(|method| !asked(method)).map(|method| {
        let used = usable(&minima::of_grids(method, &split.fitted, None), options);
        let found: Vec<Minimum> = used.into_iter().filter(|m| !m.is_best_run_instead()).collect();
        (format!("minima: {method}"), found)
    });
    rows.filter(|(_, found)| found.len() >= 2).collect::<Vec<_>>().into_iter()
}

/// The row of another convention of parameters: a model's size is N_nv + N_v, and N_v has no law of
/// its own. None where the table tells no N_v apart, or has too few minima so counted.
fn size_with_vocabulary(
    method: MinimumMethod,
    split: &Split,
    options: &FitOptions,
) -> Option<Sensitivity> {
    // The surface needs both parameters; the parabola is its nearest kin.
    let method = if method == MinimumMethod::Surface { MinimumMethod::Parabola } else { method };
    let grids: Vec<Grid> = split.fitted.iter().filter_map(Grid::with_total_size).collect();
    let used = usable(&minima::of_grids(method, &grids, None), options);
    let total = FitOptions { parameters: Parameters::Total, ..options.clone() };
    let columns = Columns::new(&used, &grids, &total);
    let row = numbers("size: N = N_nv + N_v".into(), &columns, false, &total);
    row.exponent_params.map(|_| row)
}

fn numbers(
    variant: String,
    columns: &Columns,
    has_vocab_law: bool,
    options: &FitOptions,
) -> Sensitivity {
    let laws = law_set(columns, geometric_mean(&columns.compute), options);
    let laws = laws.as_ref();
    let vocab = laws.filter(|_| has_vocab_law).and_then(|l| l.params_vocab.as_ref());
    let size = laws.map(|l| l.params_nonvocab.exponent);
    let is_total = options.parameters == Parameters::Total;
    Sensitivity {
        variant,
        exponent_vocab: vocab.map(|law| law.exponent),
        exponent_nonvocab: size.filter(|_| !is_total),
        exponent_params: size.filter(|_| is_total),
        exponent_tokens: laws.map(|l| l.tokens.exponent),
        slope_per_decade: laws.map(|l| l.loss.slope_per_decade),
    }
}
