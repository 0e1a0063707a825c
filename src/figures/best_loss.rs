//! The best L_u of each budget: with the laws of the loss, against the amount of data, and by generator.

use std::collections::BTreeMap;

use super::axis::{Axis, COMPUTE, Scale, signed};
use super::cells::{Cells, Drawing, Sources};
use super::fitted::{Role, explain_roles, interval95, known_minima, law_name};
use super::legend::{Legend, Look, Sample, category_looks, law_stroke, ordered_looks};
use super::page::Page;
use super::panel::{BAND, Plot};
use super::scene::{Point, Stroke};
use super::style::{JOINT_LAW, LAW, SECOND_LAW};
use crate::laws::{Candidate, FloorLaw, JointLaw, Laws, LogLaw};
use crate::record::RunRecord;
use crate::spec::FlopsRule;

// Against C.

/// The best L_u of each budget against C, with both loss laws and the held-out point (ScaMo Fig. 3b).
pub fn loss_vs_budget(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let (minima, answer) = (known_minima(laws)?, laws.answer());
    let others = others(laws, sources.loss_symbol());
    // The loss of the optimum along the fitted budgets, by the recommended law.
    let path = answer.path.iter().filter_map(|at| Some((at.budget_flops, at.loss?)));
    let path: Vec<_> = path.collect();
    let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
    let measured = minima.iter().map(|(minimum, _)| minimum.loss_normalised);
    // The predictions of the laws at each budget; the errors at the held-out one should be visible.
    let predicted = budgets.clone().flat_map(|flops| {
        let log = laws.loss.log.as_ref().map(|law| law.loss_at(flops));
        let floor = laws.loss.floor.as_ref().map(|law| law.loss_at(flops, laws.reference_flops));
        log.into_iter().chain(floor)
    });
    let x = Axis::new(COMPUTE, Scale::Log, budgets)?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, measured.chain(predicted))?;
    let mut plot = Plot::new([], x, y);
    for law in others.iter().rev() {
        plot.curve(plot.x.ends(), &law.loss, law.stroke);
    }
    plot.law(&path, LAW);
    for (minimum, role) in &minima {
        let at = (minimum.budget_flops, minimum.loss_normalised);
        plot.mark(at, role.mark(role.colour()));
    }
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Laws");
    legend.entry(Sample::Line(law_stroke(LAW)), law_name(laws));
    if path.iter().any(|(_, own)| own.ci95.is_some()) {
        legend.entry(Sample::Band(LAW.tint(BAND)), "its 95 % interval");
    }
    for law in &others {
        legend.entry(Sample::Line(law.stroke), law.name);
    }
    let loss = if sources.input.loss_name.is_none() { "normalised loss" } else { "loss" };
    let title = sources.title(&format!("best {loss} at each budget"));
    let remarks = remarks(laws, &answer.formula, &others, sources.loss_symbol()[1]);
    Ok(Page { width: 1000.0, height: 620.0, title, remarks, legend }.panels(vec![plot]))
}

/// A law beside the one to believe.
struct Other<'a> {
    name: &'static str,
    stroke: Stroke,
    loss: Box<dyn Fn(f64) -> f64 + 'a>,
    /// In words.
    about: String,
}

/// The log law and the law with a floor, if they are not the recommended law; the loss has a symbol and a unit.
fn others<'a>(laws: &'a Laws, words: [&str; 2]) -> Vec<Other<'a>> {
    let own = laws.recommended_law();
    let log = laws.loss.log.as_ref().filter(|_| own != Candidate::Log).map(|law| Other {
        name: "log law (Eq. 14)",
        stroke: law_stroke(JOINT_LAW),
        loss: Box::new(|flops| law.loss_at(flops)),
        about: describe_log(law, words),
    });
    let floor = laws.loss.floor.as_ref().filter(|_| own != Candidate::Floor).map(|law| Other {
        name: "law with a floor",
        stroke: law_stroke(SECOND_LAW).dashed(),
        loss: Box::new(|flops| law.loss_at(flops, laws.reference_flops)),
        about: describe_floor(law, words),
    });
    log.into_iter().chain(floor).collect()
}

/// The law to believe in numbers, and the others with their errors at the held-out budget.
fn remarks(laws: &Laws, formula: &str, others: &[Other], unit: &str) -> String {
    let recommended = laws.judgement.recommended.as_ref().and_then(|recommended| {
        Some(format!(
            "Recommended: {}, which missed larger budgets of {} by {:.3}{unit} (root mean square).",
            recommended.law.about(),
            if laws.from_sweep { "this sweep" } else { "these runs" },
            recommended.scores.first()?.rms
        ))
    });
    let formula = Some(formula.to_owned()).filter(|formula| !formula.is_empty());
    let others = others.iter().map(|law| law.about.clone());
    let lines: Vec<_> = recommended.into_iter().chain(formula).chain(others).collect();
    if lines.is_empty() { "No loss law could be fitted.".to_owned() } else { lines.join("\n") }
}

fn describe_floor(law: &FloorLaw, [symbol, unit]: [&str; 2]) -> String {
    if law.is_at_bound() {
        return "Floor law: its exponent runs into a bound, so no floor is identified.".to_owned();
    }
    format!(
        "Floor law: {symbol} = {} + {}·(C/C₀)^{}{}.",
        signed(law.floor, 3),
        signed(law.coefficient, 3),
        signed(-law.exponent, 3),
        quality(law.goodness(), law.held_out_error, unit)
    )
}

fn describe_log(law: &LogLaw, [symbol, unit]: [&str; 2]) -> String {
    let interval = law.slope_ci95.map(|ends| format!(" ({})", interval95(ends)));
    let interval = interval.unwrap_or_default();
    format!(
        "Log law: {symbol} = {}·log₁₀ C + {}{interval}{}.",
        signed(law.slope_per_decade, 3),
        signed(law.intercept, 2),
        quality(law.goodness(), law.held_out_error, unit)
    )
}

fn quality(r2_and_aic: Option<[f64; 2]>, held_out_error: Option<f64>, unit: &str) -> String {
    let r2 = r2_and_aic.map(|[r2, _]| format!(", R² = {r2:.3}")).unwrap_or_default();
    let error = held_out_error.map(|error| {
        let sign = if error < 0.0 { "" } else { "+" };
        format!(", held-out error {sign}{}{unit}", signed(error, 3))
    });
    r2 + &error.unwrap_or_default()
}

// Against the amount of data.

/// Whether runs saw different shares of the data.
pub fn has_shares(records: &[RunRecord]) -> bool {
    records.windows(2).any(|pair| pair[0].share() != pair[1].share())
}

/// The best L_u of each budget against the distinct tokens of the data, with the joint law.
pub fn loss_vs_data(sources: &Sources) -> Drawing {
    if !has_shares(sources.input.records) {
        return Err("it needs runs on several shares of the data (grid.shares)".to_owned());
    }
    let best = best_of_shares(sources);
    let looks = ordered_looks(best.len());
    let law = joint_law(sources);
    let points = || best.values().flatten();
    let label = "Distinct tokens trained on, end tokens included";
    let x = Axis::new(label, Scale::Log, points().map(|(distinct, _)| *distinct))?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, points().map(|(_, loss)| *loss))?;
    let mut plot = Plot::new([], x, y);
    for ((budget, points), look) in best.iter().zip(&looks) {
        if let Some(law) = &law {
            let best = |distinct| law.on_data(distinct).optimum(f64::from_bits(*budget));
            let loss = |distinct| best(distinct).map_or(f64::NAN, |best| best.loss);
            plot.curve(plot.x.ends(), loss, law_stroke(look.colour));
        }
        plot.marks(points.iter().copied(), *look);
    }
    let mut legend = Legend::default();
    let budgets: Vec<f64> = best.keys().map(|bits| f64::from_bits(*bits)).collect();
    let sample = |look: Look| Sample::Mark(look.mark());
    legend.budgets(&budgets, &looks, sources.held_out_budget(), sample);
    if law.is_some() {
        legend.heading("Law");
        legend.entry(Sample::Line(looks[0].stroke()), "joint law, its optimum");
    }
    let remarks = "At each budget the best cell of each share of the data; a smaller share is seen more often. \
                   The best of several cells that scatter is a little too good."
        .to_owned();
    let title = sources.title("loss against the amount of data");
    Ok(Page { width: 1000.0, height: 620.0, title, remarks, legend }.panels(vec![plot]))
}

/// The joint law of all budgets, if it has the worth of repeated data.
fn joint_law(sources: &Sources) -> Option<JointLaw> {
    let joint = sources.input.laws?.judgement.joint.as_ref();
    let mut own = joint.filter(|law| law.loss.terms.repeats)?.clone();
    // A curve asks for the law at many amounts of data, and never for its replicates.
    own.bootstrap.clear();
    Some(own)
}

/// The best cells of each budget, by the distinct tokens that they were trained on.
fn best_of_shares(sources: &Sources) -> BTreeMap<u64, Vec<Point>> {
    let mut shares: BTreeMap<u64, Vec<RunRecord>> = BTreeMap::new();
    for record in sources.input.records {
        shares.entry(record.share().to_bits()).or_default().push(record.clone());
    }
    let mut best = BTreeMap::<u64, Vec<Point>>::new();
    for records in shares.values() {
        let distinct = records.iter().filter_map(|record| record.measured.unique_tokens);
        let Some(distinct) = distinct.max() else { continue };
        for cell in Cells::of(records, sources.rule).envelope() {
            let own = best.entry(cell.budget_flops.to_bits()).or_default();
            own.push((distinct as f64, cell.loss_normalised));
        }
    }
    best
}

// By generator.

/// The runs of a generator.
pub struct GeneratorRuns<'a> {
    pub name: &'a str,
    pub records: &'a [RunRecord],
}

/// The best L_u of each budget against C, a line a generator; or the reason why there is no page.
pub fn generators(sweep: &str, generators: &[GeneratorRuns], rule: FlopsRule) -> Drawing {
    let line = |own: &GeneratorRuns| -> Vec<Point> {
        Cells::of(own.records, rule).envelope().iter().map(|cell| cell.at_its_flops()).collect()
    };
    let lines: Vec<Vec<Point>> = generators.iter().map(line).collect();
    let points = || lines.iter().flatten();
    let x = Axis::new(COMPUTE, Scale::Log, points().map(|point| point.0))?;
    let y = Axis::new("Normalised loss Lᵤ (nats)", Scale::Linear, points().map(|point| point.1))?;
    let (mut plot, mut legend) = (Plot::new([], x, y), Legend::headed("Generator"));
    for ((own, line), look) in generators.iter().zip(&lines).zip(category_looks(lines.len())) {
        legend.entry(look.sample(), own.name);
        plot.series(line.iter().copied(), look);
    }
    let mut remarks = "The lowest loss that each generator reaches by a budget.".to_owned();
    remarks += &format!(" FLOPs counted by the {} rule.", rule.name());
    if generators.iter().any(|own| own.name == "masked") {
        remarks += "\nThe loss of a masked generator is a bound: its likelihood may be better.";
    }
    let title = format!("{sweep}: best normalised loss by generator");
    Ok(Page { width: 1000.0, height: 620.0, title, remarks, legend }.panels(vec![plot]))
}
