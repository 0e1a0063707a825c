//! L_u against V by model size, a panel a budget (ScaMo Fig. 8).

use super::axis::{Axis, Scale};
use super::cells::{CellMean, ModelSize};
use super::colour::INK;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Mark, Marker, Point, Scene};
use super::series::{Look, category_looks, explain_models, marked_line};
use super::ticks::scientific;
use super::{Drawing, Sources};

pub fn draw(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let cells = &sources.cells;
    if cells.vocabs.len() < 2 {
        return Err(format!("it needs two vocabulary sizes, the runs have {}", cells.vocabs.len()));
    }
    let looks = category_looks(cells.models.len());
    let (mut scene, panels) = page(sources, &looks).multiples(plots(sources)?);
    let best = cells.envelope();
    for ((panel, &budget), best) in panels.iter().zip(&cells.budgets).zip(best) {
        panel.backdrop(&mut scene);
        // Below the series, as a ring around the best one's marker.
        panel.mark(&mut scene, point(best), best_mark());
        for (model, look) in cells.models.iter().zip(&looks) {
            series(&mut scene, panel, sources, (model, budget), *look);
        }
    }
    Ok(scene)
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

fn plots(sources: &Sources) -> Result<Vec<Plot>, String> {
    let cells = &sources.cells;
    let vocabs: Vec<f64> = cells.vocabs.iter().map(|&n_vocab| n_vocab as f64).collect();
    let x = Axis::new("Vocabulary size V (codes)", Scale::Log, vocabs.clone())?.ticks_at(vocabs);
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, cells.losses())?;
    let held_out = sources.held_out_budget();
    let plot = |&budget: &f64| {
        let note = if held_out == Some(budget) { " (held out)" } else { "" };
        let title = format!("C = {} FLOPs{note}", scientific(budget));
        Plot { title: vec![title], x: x.clone(), y: y.clone() }
    };
    Ok(cells.budgets.iter().map(plot).collect())
}

fn series(
    scene: &mut Scene,
    panel: &Panel,
    sources: &Sources,
    (model, budget): (&ModelSize, f64),
    look: Look,
) {
    let of_series = |cell: &&CellMean| cell.model == *model && cell.budget_flops == budget;
    let cells: Vec<&CellMean> = sources.cells.cells.iter().filter(of_series).collect();
    cells.iter().for_each(|cell| panel.bar(scene, point(cell), cell.standard_error, look.colour));
    let points: Vec<_> = cells.into_iter().map(point).collect();
    marked_line(scene, panel, &points, look);
}

fn point(cell: &CellMean) -> Point {
    (cell.n_vocab as f64, cell.loss_normalised)
}

fn best_mark() -> Mark {
    Mark { marker: Marker::Circle, colour: INK, radius: 9.0, hollow: true }
}
