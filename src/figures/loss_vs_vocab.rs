//! L_u against V by model size, a panel a budget (ScaMo Fig. 8).

use super::cells::CellMean;
use super::colour::INK;
use super::series::explain_models;
use super::ticks::scientific;
use super::{
    Axis, Drawing, Legend, Look, Mark, Marker, Page, Plot, Point, Sample, Scale, Sources,
    category_looks,
};

pub fn draw(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let cells = &sources.cells;
    if cells.vocabs.len() < 2 {
        return Err(format!("it needs two vocabulary sizes, the runs have {}", cells.vocabs.len()));
    }
    let looks = category_looks(cells.models.len());
    Ok(page(sources, &looks).multiples(plots(sources, &looks)?))
}

fn page(sources: &Sources, looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    explain_models(&mut legend, sources.size_symbol(), &sources.cells.models, looks);
    legend.heading("Each budget");
    legend.entry(Sample::Mark(best_mark()), "its best cell");
    let remarks = format!(
        "At each budget, a larger vocabulary leaves fewer tokens. {}",
        sources.cells.bars_remark()
    );
    let title = sources.title("loss against vocabulary size");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

fn plots(sources: &Sources, looks: &[Look]) -> Result<Vec<Plot>, String> {
    let cells = &sources.cells;
    let vocabs: Vec<f64> = cells.vocabs.iter().map(|&n_vocab| n_vocab as f64).collect();
    let x = Axis::new("Vocabulary size V (codes)", Scale::Log, vocabs.clone())?.ticks_at(vocabs);
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, cells.losses())?;
    let held_out = sources.held_out_budget();
    let plot = |best: &CellMean| {
        let budget = best.budget_flops;
        let note = if held_out == Some(budget) { " (held out)" } else { "" };
        let title = format!("C = {} FLOPs{note}", scientific(budget));
        let mut plot = Plot::new([title], x.clone(), y.clone());
        // Below the series, as a ring around the best one's marker.
        plot.mark(point(best), best_mark());
        for (model, look) in cells.models.iter().zip(looks) {
            let is_own = |c: &&CellMean| c.model == *model && c.budget_flops == budget;
            let own: Vec<&CellMean> = cells.cells.iter().filter(is_own).collect();
            own.iter().for_each(|c| plot.bar(point(c), c.standard_error, look.colour));
            plot.series(&own.into_iter().map(point).collect::<Vec<_>>(), *look);
        }
        plot
    };
    Ok(cells.envelope().into_iter().map(plot).collect())
}

fn point(cell: &CellMean) -> Point {
    (cell.n_vocab as f64, cell.loss_normalised)
}

fn best_mark() -> Mark {
    Mark { marker: Marker::Circle, colour: INK, radius: 9.0, hollow: true }
}
