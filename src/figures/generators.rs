//! The best L_u of each budget against C, a line a generator.

use super::{Axis, COMPUTE, Cells, Drawing, Legend, Page, Plot, Point, Scale, category_looks};
use crate::record::RunRecord;
use crate::spec::FlopsRule;

/// The runs of a generator.
pub struct GeneratorRuns<'a> {
    pub name: &'a str,
    pub records: &'a [RunRecord],
}

/// The page, or the reason why there is none.
pub fn draw(sweep: &str, generators: &[GeneratorRuns], rule: FlopsRule) -> Drawing {
    let line = |own: &GeneratorRuns| -> Vec<Point> {
        Cells::of(own.records, rule).envelope().iter().map(|cell| cell.at_its_flops()).collect()
    };
    let lines: Vec<Vec<Point>> = generators.iter().map(line).collect();
    let points = || lines.iter().flatten();
    let x = Axis::new(COMPUTE, Scale::Log, points().map(|point| point.0))?;
    let y = Axis::new("Normalised loss Lᵤ (nats)", Scale::Linear, points().map(|point| point.1))?;
    let (mut plot, mut legend) = (Plot::new([], x, y), Legend::default());
    legend.heading("Generator");
    for ((own, line), look) in generators.iter().zip(&lines).zip(category_looks(lines.len())) {
        legend.entry(look.sample(), own.name);
        plot.series(line, look);
    }
    let mut remarks = format!(
        "The lowest loss that each generator reaches by a budget. FLOPs counted by the {} rule.",
        rule.name()
    );
    if generators.iter().any(|own| own.name == "masked") {
        remarks += "\nThe loss of a masked generator is a bound: its likelihood may be better.";
    }
    let title = format!("{sweep}: best normalised loss by generator");
    Ok(Page { width: 1000.0, height: 620.0, title, remarks, legend }.panels(vec![plot]))
}
