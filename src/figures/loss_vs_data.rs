//! The best L_u of each budget against the distinct tokens of the data, with the joint law.

use std::collections::BTreeMap;

use super::series::explain_budgets;
use super::{
    Axis, Cells, Drawing, Legend, Look, Page, Plot, Point, Sample, Scale, Sources, law_stroke,
    ordered_looks,
};
use crate::laws::JointLaw;
use crate::record::RunRecord;

/// The name of its files.
pub const NAME: &str = "loss_vs_data";

/// Whether runs saw different shares of the data.
pub fn is_there(records: &[RunRecord]) -> bool {
    records.windows(2).any(|pair| pair[0].share() != pair[1].share())
}

/// The best cells of each budget, by the distinct tokens that they were trained on.
type Best = BTreeMap<u64, Vec<Point>>;

pub fn draw(sources: &Sources) -> Drawing {
    if !is_there(sources.input.records) {
        return Err("it needs runs on several shares of the data (grid.shares)".to_owned());
    }
    let best = best(sources);
    let looks = ordered_looks(best.len());
    let law = law(sources);
    let points = || best.values().flatten();
    let label = "Distinct tokens trained on, end tokens included";
    let x = Axis::new(label, Scale::Log, points().map(|(distinct, _)| *distinct))?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, points().map(|(_, loss)| *loss))?;
    let mut plot = Plot::new([], x, y);
    for ((budget, points), look) in best.iter().zip(&looks) {
        if let Some(law) = &law {
            let loss = |distinct: f64| {
                let best = law.on_data(distinct).optimum(f64::from_bits(*budget));
                best.map_or(f64::NAN, |best| best.loss)
            };
            plot.curve(plot.x.ends(), loss, law_stroke(look.colour));
        }
        points.iter().for_each(|at| plot.mark(*at, look.mark()));
    }
    Ok(page(sources, &best, &looks, law.is_some()).panels(vec![plot]))
}

/// The joint law of all budgets, where it knows what repeated data is worth.
fn law(sources: &Sources) -> Option<JointLaw> {
    let joint = sources.input.laws?.judgement.joint.as_ref();
    let mut own = joint.filter(|law| law.loss.terms.repeats)?.clone();
    // A curve asks for the law at many amounts of data, and never for its replicates.
    own.bootstrap.clear();
    Some(own)
}

fn best(sources: &Sources) -> Best {
    let mut shares: BTreeMap<u64, Vec<RunRecord>> = BTreeMap::new();
    for record in sources.input.records {
        shares.entry(record.share().to_bits()).or_default().push(record.clone());
    }
    let mut best = Best::new();
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

fn page(sources: &Sources, best: &Best, looks: &[Look], has_law: bool) -> Page {
    let mut legend = Legend::default();
    let budgets: Vec<f64> = best.keys().map(|bits| f64::from_bits(*bits)).collect();
    let sample = |look: Look| Sample::Mark(look.mark());
    explain_budgets(&mut legend, &budgets, looks, sources.held_out_budget(), sample);
    if has_law {
        legend.heading("Law");
        legend.entry(Sample::Line(looks[0].stroke()), "joint law, its optimum");
    }
    let remarks = "At each budget the best cell of each share of the data; a smaller share is seen more often. \
                   The best of several cells that scatter is a little too good."
        .to_owned();
    let title = sources.title("loss against the amount of data");
    Page { width: 1000.0, height: 620.0, title, remarks, legend }
}
