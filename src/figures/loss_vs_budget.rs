//! The best L_u of each budget against C, with both loss laws and the held-out point
//! (ScaMo Fig. 3b).

use crate::laws::{Answer, Candidate, Coefficient, FloorLaw, Laws, LogLaw, Minimum};

use super::axis::{Axis, Scale};
use super::colour::{JOINT_LAW, LAW, SECOND_LAW};
use super::fitted::{Role, explain_roles, floor_loss, law_name, log_loss, minima};
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Dash, Scene};
use super::series::law_stroke;
use super::ticks::signed;
use super::{Drawing, Sources};

/// How strongly an interval is tinted with its law's colour.
const BAND: f64 = 0.16;

pub fn draw(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let minima = minima(laws);
    if minima.is_empty() {
        return Err("the laws hold no minimum".to_owned());
    }
    let answer = laws.answer();
    let path = path(&answer);
    let (mut scene, panels) =
        page(sources, laws, &answer).panels(vec![plot(sources, laws, &minima)?]);
    let panel = &panels[0];
    panel.ribbon(&mut scene, &path, LAW.tint(BAND));
    panel.backdrop(&mut scene);
    draw_laws(&mut scene, panel, laws);
    let line: Vec<(f64, f64)> = path.iter().map(|(flops, own)| (*flops, own.value)).collect();
    panel.line(&mut scene, &line, law_stroke(LAW));
    for (minimum, role) in minima {
        panel.mark(&mut scene, point(minimum), role.mark(role.colour()));
    }
    Ok(scene)
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
    let own = laws.recommended_law();
    if laws.loss.log.is_some() && own != Candidate::Log {
        legend.entry(Sample::Line(law_stroke(JOINT_LAW)), "log law (Eq. 14)");
    }
    if laws.loss.floor.is_some() && own != Candidate::Floor {
        legend.entry(Sample::Line(law_stroke(SECOND_LAW).dash(Dash::Dashed)), "law with a floor");
    }
    let title = sources.title(match sources.input.loss_name {
        None => "best normalised loss at each budget",
        Some(_) => "best loss at each budget",
    });
    let remarks = remarks(laws, answer, sources.loss_symbol());
    Page { width: 1000.0, height: 620.0, title, remarks, legend }
}

/// The law to believe in numbers, and the others with their errors at the held-out budget.
fn remarks(laws: &Laws, answer: &Answer, [symbol, unit]: [&str; 2]) -> String {
    let own = laws.recommended_law();
    let log = laws.loss.log.as_ref().filter(|_| own != Candidate::Log);
    let floor = laws.loss.floor.as_ref().filter(|_| own != Candidate::Floor);
    let log = log.map(|law| describe_log(law, symbol, unit));
    let floor = floor.map(|law| describe_floor(law, symbol, unit));
    let formula = Some(answer.formula.clone()).filter(|formula| !formula.is_empty());
    [recommended(laws, unit), formula, log, floor]
        .into_iter()
        .flatten()
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

fn describe_floor(law: &FloorLaw, symbol: &str, unit: &str) -> String {
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

fn describe_log(law: &LogLaw, symbol: &str, unit: &str) -> String {
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
    let written =
        |error: f64| format!("{}{}", if error < 0.0 { "" } else { "+" }, signed(error, 3));
    error.map_or(String::new(), |e| format!(", held-out error {}{unit}", written(e)))
}

fn plot(sources: &Sources, laws: &Laws, minima: &[(&Minimum, Role)]) -> Result<Plot, String> {
    let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
    let measured = minima.iter().map(|(minimum, _)| minimum.loss_normalised);
    let predicted = budgets.clone().flat_map(|flops| predictions(laws, flops));
    let losses = measured.chain(predicted);
    Ok(Plot {
        title: Vec::new(),
        x: Axis::new("Training compute C (FLOPs)", Scale::Log, budgets)?,
        y: Axis::new(&sources.loss_axis(), Scale::Linear, losses)?,
    })
}

/// What the laws say of a budget; the held-out one's errors should be seen.
fn predictions(laws: &Laws, flops: f64) -> impl Iterator<Item = f64> {
    let log = laws.loss.log.as_ref().map(|law| log_loss(law, flops));
    let floor = laws.loss.floor.as_ref().map(|law| floor_loss(law, laws.reference_flops, flops));
    log.into_iter().chain(floor)
}

/// The laws beside the one to believe.
fn draw_laws(scene: &mut Scene, panel: &Panel, laws: &Laws) {
    let ends = (panel.x.value(0.0), panel.x.value(1.0));
    let own = laws.recommended_law();
    if let Some(law) = laws.loss.floor.as_ref().filter(|_| own != Candidate::Floor) {
        let stroke = law_stroke(SECOND_LAW).dash(Dash::Dashed);
        panel.curve(scene, ends, |c| floor_loss(law, laws.reference_flops, c), stroke);
    }
    if let Some(law) = laws.loss.log.as_ref().filter(|_| own != Candidate::Log) {
        panel.curve(scene, ends, |c| log_loss(law, c), law_stroke(JOINT_LAW));
    }
}

fn point(minimum: &Minimum) -> (f64, f64) {
    (minimum.budget_flops, minimum.loss_normalised)
}
