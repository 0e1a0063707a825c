//! The best L_u of each budget against C, with both loss laws and the held-out point
//! (ScaMo Fig. 3b).

use crate::laws::{FloorLaw, Laws, LogLaw, Minimum};

use super::axis::{Axis, Scale};
use super::colour::{JOINT_LAW, LAW, SECOND_LAW};
use super::fitted::{Role, explain_roles, floor_loss, interval95, log_loss, minima};
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
    let (mut scene, panels) = page(sources, laws).panels(vec![plot(sources, laws, &minima)?]);
    let panel = &panels[0];
    draw_band(&mut scene, panel, laws);
    panel.backdrop(&mut scene);
    draw_laws(&mut scene, panel, laws);
    for (minimum, role) in minima {
        panel.mark(&mut scene, point(minimum), role.mark(role.colour()));
    }
    Ok(scene)
}

fn page(sources: &Sources, laws: &Laws) -> Page {
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Laws");
    if laws.loss.log.is_some() {
        legend.entry(Sample::Line(law_stroke(LAW)), "log law (Eq. 14)");
    }
    if has_band(laws) {
        legend.entry(Sample::Band(LAW.tint(BAND)), "its 95 % interval");
    }
    if laws.loss.floor.is_some() {
        legend.entry(Sample::Line(law_stroke(SECOND_LAW).dash(Dash::Dashed)), "power law, floor");
    }
    if laws.judgement.joint.is_some() {
        legend.entry(Sample::Line(law_stroke(JOINT_LAW)), "joint law");
    }
    let title = sources.title(match sources.input.loss_name {
        None => "best normalised loss at each budget",
        Some(_) => "best loss at each budget",
    });
    Page {
        width: 1000.0,
        height: 620.0,
        title,
        remarks: remarks(laws, sources.loss_symbol()),
        legend,
    }
}

/// Both laws in numbers, each with its error at the held-out budget.
fn remarks(laws: &Laws, [symbol, unit]: [&str; 2]) -> String {
    let log = laws.loss.log.as_ref().map(|law| describe_log(law, symbol, unit));
    let floor = laws.loss.floor.as_ref().map(|law| describe_floor(law, symbol, unit));
    let recommended = recommended(laws, unit);
    let missing = || "No loss law could be fitted.".to_owned();
    [recommended, log, floor]
        .into_iter()
        .flatten()
        .reduce(|a, b| format!("{a}\n{b}"))
        .unwrap_or_else(missing)
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

fn has_band(laws: &Laws) -> bool {
    laws.loss.log.is_some() && !laws.bootstrap.is_empty()
}

fn draw_band(scene: &mut Scene, panel: &Panel, laws: &Laws) {
    if has_band(laws) {
        let loss = |flops: f64| {
            interval95(&laws.bootstrap, |sample| {
                sample.loss_slope_per_decade * flops.log10() + sample.loss_intercept
            })
        };
        panel.band(scene, loss, LAW.tint(BAND));
    }
}

fn draw_laws(scene: &mut Scene, panel: &Panel, laws: &Laws) {
    let ends = (panel.x.value(0.0), panel.x.value(1.0));
    if let Some(law) = &laws.loss.floor {
        let stroke = law_stroke(SECOND_LAW).dash(Dash::Dashed);
        panel.curve(scene, ends, |c| floor_loss(law, laws.reference_flops, c), stroke);
    }
    if let Some(law) = &laws.judgement.joint {
        let loss = |c| law.optimum(c).map_or(f64::NAN, |best| best.loss);
        panel.curve(scene, ends, loss, law_stroke(JOINT_LAW));
    }
    if let Some(law) = &laws.loss.log {
        panel.curve(scene, ends, |c| log_loss(law, c), law_stroke(LAW));
    }
}

fn point(minimum: &Minimum) -> (f64, f64) {
    (minimum.budget_flops, minimum.loss_normalised)
}
