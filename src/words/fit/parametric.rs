//! A parametric law for a terminal.

use crate::laws::text::short;
use crate::laws::{Parametric, Space};
use crate::words::number::{known, span};
use crate::words::wrap;

/// Its coefficients with errors and intervals, and how well the search for them ended, in at most
/// 80 columns.
pub fn parametric_text(parametric: &Parametric) -> String {
    let names = parametric.coefficients.form.names();
    let head = format!(
        "\n{:<14}{:>14}{:>14}{:>28}\n",
        "coefficient", "estimate", "std. error", "95 % interval"
    );
    let rows: String = (0..names.len()).map(|i| row(parametric, i)).collect();
    head + &rows + "\n" + &wrap("", &how(parametric))
}

fn row(parametric: &Parametric, i: usize) -> String {
    let value = parametric.coefficients.values()[i];
    let error = known(parametric.se.get(i).copied(), number);
    let interval = span(parametric.ci95.get(i).copied(), number);
    let name = parametric.coefficients.form.names()[i];
    format!("{name:<14}{:>14}{error:>14}{interval:>28}\n", number(value))
}

/// Six significant digits.
fn number(x: f64) -> String {
    if x != 0.0 && !(1e-3..1e6).contains(&x.abs()) {
        return short(x, 4);
    }
    let whole = if x == 0.0 { 1.0 } else { x.abs().log10().floor().max(0.0) + 1.0 };
    format!("{x:.*}", (6.0 - whole).max(0.0) as usize)
}

fn how(p: &Parametric) -> String {
    let loss = match p.space {
        Space::Log => "ln L",
        Space::Raw => "L",
    };
    let what = match p.huber_delta {
        Some(delta) => format!("Huber's function with delta = {} of", short(delta, 3)),
        None => "half the squares of".into(),
    };
    let tied = if p.tied { "; the exponents of model and data are kept equal" } else { "" };
    let replicates = match p.bootstrap.len() {
        0 => String::new(),
        all => format!("; {} of {all} bootstrap replicates converged", p.replicates_converged),
    };
    format!(
        "{} is the least sum of {what} the residuals of {loss} over {} runs{tied}. The gradient's \
         norm there is {}; {} of {} starts end there{replicates}.",
        short(p.objective_sum, 10),
        p.n,
        short(p.gradient_norm, 1),
        p.starts_at_optimum,
        p.starts
    )
}
