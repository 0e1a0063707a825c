//! The best L_u of each budget against C, with both loss laws and the held-out point
//! (ScaMo Fig. 3b).

use super::colour::{JOINT_LAW, LAW, SECOND_LAW};
use super::fitted::{Role, explain_roles, known_minima, law_name};
use super::panel::BAND;
use super::ticks::signed;
use super::{
    Axis, COMPUTE, Drawing, Legend, Page, Plot, Sample, Scale, Sources, Stroke, law_stroke,
};
use crate::laws::{Answer, Candidate, Coefficient, FloorLaw, Laws, LogLaw, Minimum};

pub fn draw(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let minima = known_minima(laws)?;
    let answer = laws.answer();
    let mut plot = plot(sources, laws, &minima)?;
    for law in others(laws).into_iter().rev() {
        plot.curve(plot.x.ends(), law.loss, law.stroke);
    }
    plot.law(&path(&answer), LAW);
    for (minimum, role) in minima {
        let at = (minimum.budget_flops, minimum.loss_normalised);
        plot.mark(at, role.mark(role.colour()));
    }
    Ok(page(sources, laws, &answer).panels(vec![plot]))
}

type About<'a> = Box<dyn Fn([&str; 2]) -> String + 'a>;

/// A law beside the one to believe.
struct Other<'a> {
    name: &'static str,
    stroke: Stroke,
    loss: Box<dyn Fn(f64) -> f64 + 'a>,
    /// In words, given the symbol of the loss and its unit.
    about: About<'a>,
}

/// The log law and the law with a floor, if they are not the law to believe.
fn others(laws: &Laws) -> Vec<Other<'_>> {
    let own = laws.recommended_law();
    let log = laws.loss.log.as_ref().filter(|_| own != Candidate::Log).map(|law| Other {
        name: "log law (Eq. 14)",
        stroke: law_stroke(JOINT_LAW),
        loss: Box::new(move |flops| law.loss_at(flops)),
        about: Box::new(move |words| describe_log(law, words)),
    });
    let floor = laws.loss.floor.as_ref().filter(|_| own != Candidate::Floor).map(|law| Other {
        name: "law with a floor",
        stroke: law_stroke(SECOND_LAW).dashed(),
        loss: Box::new(move |flops| law.loss_at(flops, laws.reference_flops)),
        about: Box::new(move |words| describe_floor(law, words)),
    });
    log.into_iter().chain(floor).collect()
}

/// The loss of the optimum along the fitted budgets, by the law to believe.
fn path(answer: &Answer) -> Vec<(f64, Coefficient)> {
    answer.path.iter().filter_map(|at| Some((at.budget_flops, at.loss?))).collect()
}

fn page(sources: &Sources, laws: &Laws, answer: &Answer) -> Page {
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Laws");
    legend.entry(Sample::Line(law_stroke(LAW)), law_name(laws));
    if path(answer).iter().any(|(_, own)| own.ci95.is_some()) {
        legend.entry(Sample::Band(LAW.tint(BAND)), "its 95 % interval");
    }
    for law in others(laws) {
        legend.entry(Sample::Line(law.stroke), law.name);
    }
    let title = sources.title(match sources.input.loss_name {
        None => "best normalised loss at each budget",
        Some(_) => "best loss at each budget",
    });
    let remarks = remarks(laws, answer, sources.loss_symbol());
    Page { width: 1000.0, height: 620.0, title, remarks, legend }
}

/// The law to believe in numbers, and the others with their errors at the held-out budget.
fn remarks(laws: &Laws, answer: &Answer, words: [&str; 2]) -> String {
    let formula = Some(answer.formula.clone()).filter(|formula| !formula.is_empty());
    let others = others(laws);
    let others = others.iter().map(|law| (law.about)(words));
    let lines = recommended(laws, words[1]).into_iter().chain(formula).chain(others);
    lines
        .reduce(|a, b| format!("{a}\n{b}"))
        .unwrap_or_else(|| "No loss law could be fitted.".to_owned())
}

/// The law that predicts, and how far it missed budgets that it had not seen.
fn recommended(laws: &Laws, unit: &str) -> Option<String> {
    let recommended = laws.judgement.recommended.as_ref()?;
    let best = recommended.scores.first()?;
    Some(format!(
        "Recommended: {}, which missed larger budgets of {} by {:.3}{unit} (root mean square).",
        recommended.law.about(),
        if laws.from_sweep { "this sweep" } else { "these runs" },
        best.rms
    ))
}

fn describe_floor(law: &FloorLaw, [symbol, unit]: [&str; 2]) -> String {
    if law.is_at_bound() {
        return "Floor law: its exponent runs into a bound, so no floor is identified.".to_owned();
    }
    format!(
        "Floor law: {symbol} = {} + {}·(C/C₀)^{}{}{}.",
        signed(law.floor, 3),
        signed(law.coefficient, 3),
        signed(-law.exponent, 3),
        goodness(law.goodness()),
        held_out_error(law.held_out_error, unit)
    )
}

fn describe_log(law: &LogLaw, [symbol, unit]: [&str; 2]) -> String {
    let interval = law.slope_ci95.map_or(String::new(), |[low, high]| {
        format!(" (95 % interval {} to {})", signed(low, 3), signed(high, 3))
    });
    format!(
        "Log law: {symbol} = {}·log₁₀ C + {}{interval}{}{}.",
        signed(law.slope_per_decade, 3),
        signed(law.intercept, 2),
        goodness(law.goodness()),
        held_out_error(law.held_out_error, unit)
    )
}

fn goodness(r2_and_aic: Option<[f64; 2]>) -> String {
    r2_and_aic.map_or_else(String::new, |[r2, _]| format!(", R² = {r2:.3}"))
}

fn held_out_error(error: Option<f64>, unit: &str) -> String {
    let sign = |error: f64| if error < 0.0 { "" } else { "+" };
    error.map_or(String::new(), |e| format!(", held-out error {}{}{unit}", sign(e), signed(e, 3)))
}

fn plot(sources: &Sources, laws: &Laws, minima: &[(&Minimum, Role)]) -> Result<Plot, String> {
    let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
    let measured = minima.iter().map(|(minimum, _)| minimum.loss_normalised);
    let predicted = budgets.clone().flat_map(|flops| predictions(laws, flops));
    let x = Axis::new(COMPUTE, Scale::Log, budgets)?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, measured.chain(predicted))?;
    Ok(Plot::new([], x, y))
}

/// What the laws say of a budget; the held-out one's errors should be seen.
fn predictions(laws: &Laws, flops: f64) -> impl Iterator<Item = f64> {
    let log = laws.loss.log.as_ref().map(|law| law.loss_at(flops));
    let floor = laws.loss.floor.as_ref().map(|law| law.loss_at(flops, laws.reference_flops));
    log.into_iter().chain(floor)
}
