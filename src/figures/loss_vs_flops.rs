//! L_u against training FLOPs, a panel a vocabulary, with the lower envelope (ScaMo Fig. 2).

use super::cells::CellMean;
use super::colour::ENVELOPE;
use super::series::explain_models;
use super::words::few_enough;
use super::{
    Axis, COMPUTE, Drawing, Legend, Look, Page, Plot, Sample, Scale, Sources, Stroke,
    category_looks,
};

pub fn draw(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.cells.is_empty() {
        return Err("there is no finished run".to_owned());
    }
    few_enough(cells.models.len(), "model sizes")?;
    few_enough(cells.vocabs.len(), "vocabularies")?;
    let looks = category_looks(cells.models.len());
    Ok(page(sources, &looks).multiples(plots(sources, &looks)?))
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

fn plots(sources: &Sources, looks: &[Look]) -> Result<Vec<Plot>, String> {
    let cells = &sources.cells;
    let flops = cells.cells.iter().map(|cell| cell.flops);
    let x = Axis::new(COMPUTE, Scale::Log, flops)?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, cells.losses())?;
    let plot = |&n_vocab: &usize| {
        let title = (n_vocab > 0).then(|| format!("V = {n_vocab}"));
        let mut plot = Plot::new(title, x.clone(), y.clone());
        let envelope = cells.envelope();
        plot.line(envelope.into_iter().map(CellMean::at_its_flops), envelope_stroke());
        for (model, look) in cells.models.iter().zip(looks) {
            let own = cells.cells.iter().filter(|c| c.model == *model && c.n_vocab == n_vocab);
            plot.series(&own.map(CellMean::at_its_flops).collect::<Vec<_>>(), *look);
        }
        plot
    };
    Ok(cells.vocabs.iter().map(plot).collect())
}

fn envelope_stroke() -> Stroke {
    Stroke::solid(ENVELOPE, 6.0)
}
