//! The fit in full, as tables: coefficients, laws, minima, and the laws under other choices.

use super::{advice, brief, unseen_budgets, verdict};
use crate::laws::text::{count, short};
use crate::laws::{
    FloorLaw, JointLaw, Laws, LogLaw, Minimum, NoiseSource, Parameters, Parametric, PowerLaw,
    RunNoise, Sensitivity, Space, flags_text,
};
use crate::words::{COLUMNS, four, known, listed, span, wrap};

/// The first screen, then the coefficients of a parametric loss, laws with intervals, loss laws with their
/// held-out errors, minima with flags, errors on unseen budgets, the sensitivity table, runs to add and
/// warnings, in at most 80 columns and without colour.
pub fn summary(laws: &Laws) -> String {
    let reference = format!(
        "C0 = {} FLOPs, the middle of the fitted budgets{}",
        count(laws.reference_flops),
        noise(laws)
    );
    [
        brief(laws) + "\n",
        verdict(laws).iter().map(|sentence| wrap("- ", sentence)).collect(),
        laws.parametric.as_ref().map_or_else(String::new, parametric) + "\n",
        wrap("", &reference),
        power_laws(laws),
        loss_laws(laws),
        repetition(laws),
        minima(laws),
        unseen_budgets(laws),
        sensitivity(laws),
        advice(laws),
        listed("warnings", laws.warnings.iter().cloned()),
    ]
    .concat()
}

fn noise(laws: &Laws) -> String {
    let Some(RunNoise { sd, dof, source }) = laws.noise else {
        return String::new();
    };
    let source = match source {
        NoiseSource::Seeds => "seeds".to_string(),
        NoiseSource::Tokenizers => "tokenizers".to_string(),
        NoiseSource::Surface { degree } => format!("a surface of degree {degree}"),
    };
    let sd = laws.metric.said(&short(sd, 2));
    format!("; one run scatters by {sd} ({dof} degrees of freedom, {source})")
}

/// The coefficients of a parametric law with errors and intervals, and the convergence of the search.
fn parametric(parametric: &Parametric) -> String {
    let head = format!(
        "\n{:<14}{:>14}{:>14}{:>28}\n",
        "coefficient", "estimate", "std. error", "95 % interval"
    );
    let (names, values) = (parametric.coefficients.form.names(), parametric.coefficients.values());
    let row = |(i, name)| {
        let error = known(parametric.se.get(i).copied(), six);
        let interval = span(parametric.ci95.get(i).copied(), six);
        format!("{name:<14}{:>14}{error:>14}{interval:>28}\n", six(values[i]))
    };
    let rows: String = names.iter().enumerate().map(row).collect();
    head + &rows + "\n" + &wrap("", &how(parametric))
}

/// Six significant digits.
fn six(x: f64) -> String {
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

fn power_laws(laws: &Laws) -> String {
    let tokens = ("D    in C", &laws.power_laws.tokens);
    let rows = match laws.parameters {
        Parameters::Split => vec![
            ("N_nv in C", &laws.power_laws.params_nonvocab),
            ("N_v  in C", &laws.power_laws.params_vocab),
            tokens,
            ("N_v  in N_nv", &laws.vocab_from_nonvocab),
        ],
        Parameters::Total => vec![("N    in C", &laws.power_laws.params), tokens],
    };
    let head = format!(
        "\n{:<14}{:>10}{:>18}{:>14}{:>12}{:>8}{:>4}\n",
        "law", "exponent", "95 % interval", "log10 coef.", "at C0", "R2", "n"
    );
    let row = |(name, law): (&str, &Option<PowerLaw>)| match law {
        Some(law) => power(name, law, laws),
        None => format!("{name:<14}{:>10}\n", "absent"),
    };
    head + &rows.into_iter().map(row).collect::<String>()
}

fn power(name: &str, law: &PowerLaw, laws: &Laws) -> String {
    // A law derived from a parametric loss is fitted to no points.
    let r2 = known(law.told_r2().filter(|_| laws.parametric.is_none()), four);
    format!(
        "{name:<14}{:>10.4}{:>18}{:>14.4}{:>12}{r2:>8}{:>4}\n",
        law.exponent,
        span(law.exponent_ci95, four),
        law.log10_coefficient,
        count(law.ln_at_reference.exp()),
        law.n
    )
}

fn loss_laws(laws: &Laws) -> String {
    let loss = laws.loss_symbol();
    let mut text = format!("\n{:<50}{:>8}{:>9}{:>13}\n", "loss law", "R2", "AIC", "held-out err");
    if let Some(law) = &laws.loss.log {
        let formula = format!("{loss} = {:.4} log10 C {:+.4}", law.slope_per_decade, law.intercept);
        text += &loss_row(&formula, law.goodness(), law.held_out_error);
        if let Some([low, high]) = law.slope_ci95 {
            text += &format!("    95 % interval of the slope {low:.4}..{high:.4}\n");
        }
    }
    if let Some(law) = &laws.loss.floor {
        let formula = format!(
            "{loss} = {} {} {} (C/C0)^-{:.4}",
            decimal(law.floor),
            if law.coefficient < 0.0 { "-" } else { "+" },
            decimal(law.coefficient.abs()),
            law.exponent
        );
        text += &loss_row(&formula, law.goodness(), law.held_out_error);
        if law.floor_ci95.is_some() && law.exponent_ci95.is_some() {
            let told = format!(
                "95 % interval of the floor {}, of the exponent {}",
                span(law.floor_ci95, decimal),
                span(law.exponent_ci95, four)
            );
            text += &wrap("    ", &told);
        }
    }
    let aic = laws.loss.log.as_ref().and_then(LogLaw::goodness);
    if aic.and(laws.loss.floor.as_ref().and_then(FloorLaw::goodness)).is_some() {
        text += "AIC: lower is better; a difference of 2 says little\n";
    }
    text
}

/// The worth of repeated data, if it is known.
fn repetition(laws: &Laws) -> String {
    let joint = laws.judgement.joint.as_ref();
    let own = joint.filter(|law| law.tells_repetition()).and_then(JointLaw::repetition);
    let Some(own) = own else { return String::new() };
    let [few, many] = [4.0, 16.0].map(|passes| own.worth(passes));
    let r = own.r_ci95.map_or(String::new(), |[l, h]| format!(", by noise {l:.1} to {h:.1}"));
    let rho =
        own.rho_ci95.map_or(String::new(), |[l, h]| format!(", by noise {:+.2} to {:+.2}", -h, -l));
    wrap(
        "",
        &format!(
            "Repeated data, at N_nv = {}: 4 passes are worth {few:.1} fresh ones, 16 are worth {many:.1} \
             (R = {:.1}{r}; R goes as N^{:+.2}{rho}).",
            count(own.params_nonvocab),
            own.r,
            -own.rho,
        ),
    )
}

/// Four decimals, or scientific if that would be wide.
fn decimal(x: f64) -> String {
    if x.abs() < 1e4 { format!("{x:.4}") } else { short(x, 3) }
}

fn loss_row(formula: &str, goodness: Option<[f64; 2]>, held_out_error: Option<f64>) -> String {
    let r2 = known(goodness.map(|[r2, _]| r2), four);
    let aic = known(goodness.map(|[_, aic]| aic), |aic| format!("{aic:.1}"));
    let error = known(held_out_error, |error| format!("{error:+.4}"));
    format!("{formula:<50}{r2:>8}{aic:>9}{error:>13}\n")
}

fn minima(laws: &Laws) -> String {
    if laws.minima.is_empty() {
        return String::new();
    }
    let head = format!(
        "\n{:<9}{:>10}{:>11}{:>11}{:>8}{:>11}{:>9}  {}\n",
        "minima",
        "budget",
        laws.parameters.size(),
        "N_v",
        "V",
        "D",
        laws.loss_symbol(),
        "flags"
    );
    let is_held_out = |m: &Minimum| {
        laws.held_out.as_ref().is_some_and(|held_out| held_out.budget_flops == m.budget_flops)
    };
    head + &laws.minima.iter().map(|m| minimum(m, is_held_out(m))).collect::<String>()
}

/// One line, with several flags on a line below.
fn minimum(m: &Minimum, is_held_out: bool) -> String {
    let mut marks: Vec<String> = is_held_out.then(|| "held out once".into()).into_iter().collect();
    marks.extend((!m.flags.is_empty()).then(|| flags_text(&m.flags)));
    // A 0 stands for an unknown value.
    let positive = |x: f64| Some(x).filter(|x| *x > 0.0);
    let line = format!(
        "{:<9}{:>10}{:>11}{:>11}{:>8}{:>11}{:>9.4}",
        m.method,
        count(m.budget_flops),
        count(m.params_nonvocab),
        known(positive(m.params_vocab), count),
        known(positive(m.n_vocab), |v| format!("{v:.0}")),
        count(m.tokens),
        m.loss_normalised
    );
    match marks.join(", ") {
        marks if marks.is_empty() => line + "\n",
        marks if line.len() + 2 + marks.len() <= COLUMNS => format!("{line}  {marks}\n"),
        marks => format!("{line}\n{}", wrap("            ", &marks)),
    }
}

fn sensitivity(laws: &Laws) -> String {
    let rows = &laws.sensitivity;
    if rows.is_empty() {
        return String::new();
    }
    let number = |x: Option<f64>| known(x, four);
    let row = |r: &Sensitivity| {
        format!(
            "{:<36}{:>10}{:>10}{:>10}{:>12}\n",
            r.variant,
            number(r.exponent_nonvocab.or(r.exponent_params)),
            number(r.exponent_vocab),
            number(r.exponent_tokens),
            number(r.slope_per_decade)
        )
    };
    let head = format!(
        "\n{:<36}{:>10}{:>10}{:>10}{:>12}\n",
        "exponents under other choices",
        laws.parameters.size(),
        "N_v",
        "D",
        format!("{}/decade", laws.metric.unit().unwrap_or("loss"))
    );
    head + &rows.iter().map(row).collect::<String>()
}
