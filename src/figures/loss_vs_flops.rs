//! L_u against training FLOPs, a panel a vocabulary, with the lower envelope (ScaMo Fig. 2).

use super::axis::{Axis, Scale};
use super::cells::{CellMean, ModelSize};
use super::colour::ENVELOPE;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Point, Scene, Stroke};
use super::series::{Look, category_looks, explain_models, marked_line};
use super::words::few_enough;
use super::{Drawing, Sources};

pub fn draw(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.cells.is_empty() {
        return Err("there is no finished run".to_owned());
    }
    few_enough(cells.models.len(), "model sizes")?;
    few_enough(cells.vocabs.len(), "vocabularies")?;
    let looks = category_looks(cells.models.len());
    let (mut scene, panels) = page(sources, &looks).multiples(plots(sources)?);
    let envelope: Vec<Point> = cells.envelope().into_iter().map(point).collect();
    for (panel, &n_vocab) in panels.iter().zip(&cells.vocabs) {
        panel.backdrop(&mut scene);
        panel.line(&mut scene, &envelope, envelope_stroke());
        for (model, look) in cells.models.iter().zip(&looks) {
            series(&mut scene, panel, sources, (model, n_vocab), *look);
        }
    }
    Ok(scene)
}

fn page(sources: &Sources, looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    explain_models(&mut legend, sources.size_symbol(), &sources.cells.models, looks);
    legend.heading(if sources.knows_size_alone() { "All models" } else { "All vocabularies" });
    legend.entry(Sample::Line(envelope_stroke()), "lower envelope");
    let remarks = format!(
        "Each line joins the runs of one model over its budgets. {} FLOPs counted by the {} rule.",
        sources.cells.seeds_remark(),
        sources.rule.name()
    );
    let title = sources.title("loss against training compute");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

fn plots(sources: &Sources) -> Result<Vec<Plot>, String> {
    let cells = &sources.cells;
    let flops = cells.cells.iter().map(|cell| cell.flops);
    let x = Axis::new("Training compute C (FLOPs)", Scale::Log, flops)?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, cells.losses())?;
    let plot = |n_vocab: &usize| Plot {
        title: (*n_vocab > 0).then(|| format!("V = {n_vocab}")).into_iter().collect(),
        x: x.clone(),
        y: y.clone(),
    };
    Ok(cells.vocabs.iter().map(plot).collect())
}

fn series(
    scene: &mut Scene,
    panel: &Panel,
    sources: &Sources,
    (model, n_vocab): (&ModelSize, usize),
    look: Look,
) {
    let of_series = |cell: &&CellMean| cell.model == *model && cell.n_vocab == n_vocab;
    let points: Vec<_> = sources.cells.cells.iter().filter(of_series).map(point).collect();
    marked_line(scene, panel, &points, look);
}

fn point(cell: &CellMean) -> Point {
    (cell.flops, cell.loss_normalised)
}

fn envelope_stroke() -> Stroke {
    Stroke::solid(ENVELOPE, 6.0)
}
