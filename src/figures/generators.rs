//! The best L_u of each budget against C, a line a generator.

use super::axis::{Axis, Scale};
use super::cells::Cells;
use super::legend::Legend;
use super::page::{Page, Plot};
use super::scene::{Point, Scene};
use super::series::{category_looks, marked_line};
use crate::record::RunRecord;
use crate::spec::FlopsRule;

/// The runs of a generator.
pub struct GeneratorRuns<'a> {
    pub name: &'a str,
    pub records: &'a [RunRecord],
}

/// The page, or the reason why there is none.
pub fn draw(sweep: &str, generators: &[GeneratorRuns], rule: FlopsRule) -> Result<Scene, String> {
    let lines: Vec<Vec<Point>> = generators
        .iter()
        .map(|own| {
            let cells = Cells::of(own.records, rule);
            cells.envelope().iter().map(|cell| (cell.flops, cell.loss_normalised)).collect()
        })
        .collect();
    let points = || lines.iter().flatten();
    let x = Axis::new("Training compute C (FLOPs)", Scale::Log, points().map(|point| point.0))?;
    let y = Axis::new("Normalised loss Lᵤ (nats)", Scale::Linear, points().map(|point| point.1))?;
    let looks = category_looks(generators.len());
    let (mut scene, panels) =
        page(sweep, generators, rule, &looks).panels(vec![Plot { title: Vec::new(), x, y }]);
    panels[0].backdrop(&mut scene);
    for (line, look) in lines.iter().zip(&looks) {
        marked_line(&mut scene, &panels[0], line, *look);
    }
    Ok(scene)
}

fn page(
    sweep: &str,
    generators: &[GeneratorRuns],
    rule: FlopsRule,
    looks: &[super::series::Look],
) -> Page {
    let mut legend = Legend::default();
    legend.heading("Generator");
    for (own, look) in generators.iter().zip(looks) {
        legend.entry(look.sample(), own.name);
    }
    let mut remarks = format!(
        "The lowest loss that each generator reaches by a budget. FLOPs counted by the {} rule.",
        rule.name()
    );
    if generators.iter().any(|own| own.name == "masked") {
        remarks += "\nThe loss of a masked generator is a bound: its likelihood may be better.";
    }
    let title = format!("{sweep}: best normalised loss by generator");
    Page { width: 1000.0, height: 620.0, title, remarks, legend }
}
