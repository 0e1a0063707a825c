//! The exponents under other choices, one row a choice.

use crate::laws::file::laws::Laws;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::Parameters;
use crate::laws::lines::law_set::LawSet;
use crate::laws::lines::types::{PowerLaws, Sensitivity};
use crate::laws::minima;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::select::{n_vocabularies, usable};
use crate::laws::minima::types::Minimum;

/// The row of laws that were fitted under another convention.
///
/// A table of points carries one FLOP rule, so the rows for other rules come from refits: move the
/// points to equal FLOPs by the other rule ([`slices`](crate::laws::lines::slices::slices())), fit without a bootstrap, and
/// push this row onto [`Laws::sensitivity`] of the main fit.
pub fn sensitivity_row(variant: &str, laws: &Laws) -> Sensitivity {
    let slope = laws.loss.log.as_ref().map(|law| law.slope_per_decade);
    row(variant.to_string(), &laws.power_laws, slope)
}

fn row(variant: String, laws: &PowerLaws, slope_per_decade: Option<f64>) -> Sensitivity {
    let exponents = laws.map(|law| law.exponent);
    Sensitivity {
        variant,
        exponent_vocab: exponents.params_vocab,
        exponent_nonvocab: exponents.params_nonvocab,
        exponent_params: exponents.params,
        exponent_tokens: exponents.tokens,
        slope_per_decade,
    }
}

/// One row for each kind of minimum, one more with every flagged minimum of `law_method` kept, and one
/// where a model's size is all its parameters. A row's numbers are absent where fewer than two budgets have a usable minimum of that kind.
pub(in crate::laws) fn by_method(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    law_method: MinimumMethod,
    grids: &[Grid],
    options: &FitOptions,
) -> Vec<Sensitivity> {
    let has_vocab_law = n_vocabularies(grids) > 1;
    let row = |variant: String, minima: &[Minimum]| {
        through(variant, (minima, grids), has_vocab_law, options)
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
    rows.extend(other_methods(per_method, grids, options).map(|(m, used)| row(m, &used)));
    rows.extend(size_with_vocabulary(law_method, grids, options));
    rows
}

/// Akima's spline and the surface where they were not asked for and two budgets have one.
fn other_methods(
    per_method: &[(MinimumMethod, Vec<Minimum>)],
    grids: &[Grid],
    options: &FitOptions,
) -> impl Iterator<Item = (String, Vec<Minimum>)> {
    let asked = |method: &MinimumMethod| per_method.iter().any(|(asked, _)| asked == method);
    let methods = [MinimumMethod::Akima, MinimumMethod::Surface];
    let rows = methods.into_iter().filter(|method| !asked(method)).map(|method| {
        let used = usable(&minima::of_grids(method, grids, None), options);
        let found: Vec<Minimum> = used.into_iter().filter(|m| !m.is_best_run_instead()).collect();
        (format!("minima: {method}"), found)
    });
    rows.filter(|(_, found)| found.len() >= 2).collect::<Vec<_>>().into_iter()
}

/// The row of another convention of parameters: a model's size is N_nv + N_v, and N_v has no law of
/// its own. None where the table tells no N_v apart, or has too few minima so counted.
fn size_with_vocabulary(
    method: MinimumMethod,
    grids: &[Grid],
    options: &FitOptions,
) -> Option<Sensitivity> {
    // The surface needs both parameters; the parabola is its nearest kin.
    let method = if method == MinimumMethod::Surface { MinimumMethod::Parabola } else { method };
    let grids: Vec<Grid> = grids.iter().filter_map(Grid::with_total_size).collect();
    let used = usable(&minima::of_grids(method, &grids, None), options);
    let total = FitOptions { parameters: Parameters::Total, ..options.clone() };
    let row = through("size: N = N_nv + N_v".into(), (&used, &grids), false, &total);
    row.exponent_params.map(|_| row)
}

/// The row of the laws through some minima.
fn through(
    variant: String,
    (minima, grids): (&[Minimum], &[Grid]),
    several: bool,
    options: &FitOptions,
) -> Sensitivity {
    let set = LawSet::through(minima, grids, options);
    let laws = set.as_ref().map(|set| set.powers(several, options.parameters));
    row(variant, &laws.unwrap_or_default(), set.map(|set| set.log.slope_per_decade))
}
