//! L_u of the runs: against their FLOPs, against the vocabulary, and against the size of the model.

use nalgebra::{Matrix3, Vector3};

use super::axis::{Axis, COMPUTE, Scale, scientific, span};
use super::cells::{CellMean, Drawing, Sources, few_enough};
use super::fitted::{explain_marks, outside_remark, quantities};
use super::legend::{Legend, Look, Sample, category_looks, ordered_looks};
use super::page::Page;
use super::panel::Plot;
use super::scene::{Mark, Marker, Point, Stroke};
use super::style::{ENVELOPE, INK};
use crate::laws::{Minimum, MinimumMethod};

/// L_u against training FLOPs, a panel a vocabulary, with the lower envelope (ScaMo Fig. 2).
pub fn loss_vs_flops(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.cells.is_empty() {
        return Err("there is no finished run".to_owned());
    }
    few_enough(cells.models.len(), "model sizes")?;
    few_enough(cells.vocabs.len(), "vocabularies")?;
    let looks = category_looks(cells.models.len());
    let envelope = Stroke::solid(ENVELOPE, 6.0);
    let x = Axis::new(COMPUTE, Scale::Log, cells.cells.iter().map(|cell| cell.flops))?;
    let y = Axis::new(&sources.loss_axis(), Scale::Linear, cells.losses())?;
    let plot = |&n_vocab: &usize| {
        let title = (n_vocab > 0).then(|| format!("V = {n_vocab}"));
        let mut plot = Plot::new(title, x.clone(), y.clone());
        plot.line(cells.envelope().into_iter().map(CellMean::at_its_flops), envelope);
        for (model, look) in cells.models.iter().zip(&looks) {
            let own = cells.cells.iter().filter(|c| c.model == *model && c.n_vocab == n_vocab);
            plot.series(own.map(CellMean::at_its_flops), *look);
        }
        plot
    };
    let mut legend = Legend::models(sources.size_symbol(), &cells.models, &looks);
    legend.heading(if sources.knows_size_alone() { "All models" } else { "All vocabularies" });
    legend.entry(Sample::Line(envelope), "lower envelope");
    let remarks = format!(
        "Each line joins the runs of one model over its budgets. {} FLOPs counted by the {} rule.",
        cells.seeds_remark(false),
        sources.rule.name()
    );
    let title = sources.title("loss against training compute");
    let page = Page { width: 1000.0, height: 700.0, title, remarks, legend };
    Ok(page.multiples(cells.vocabs.iter().map(plot).collect()))
}

/// L_u against V by model size, a panel a budget (ScaMo Fig. 8).
pub fn loss_vs_vocab(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let cells = &sources.cells;
    if cells.vocabs.len() < 2 {
        return Err(format!("it needs two vocabulary sizes, the runs have {}", cells.vocabs.len()));
    }
    let looks = category_looks(cells.models.len());
    let ring = Mark { marker: Marker::Circle, colour: INK, radius: 9.0, hollow: true };
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
        plot.mark(best.at_its_vocab(), ring);
        for (model, look) in cells.models.iter().zip(&looks) {
            let is_own = |c: &&CellMean| c.model == *model && c.budget_flops == budget;
            let own = cells.cells.iter().filter(is_own);
            own.clone().for_each(|c| plot.bar(c.at_its_vocab(), c.standard_error, look.colour));
            plot.series(own.map(CellMean::at_its_vocab), *look);
        }
        plot
    };
    let mut legend = Legend::models(sources.size_symbol(), &cells.models, &looks);
    legend.heading("Each budget");
    legend.entry(Sample::Mark(ring), "its best cell");
    let seeds = cells.seeds_remark(true);
    let remarks = format!("At each budget, a larger vocabulary leaves fewer tokens. {seeds}");
    let title = sources.title("loss against vocabulary size");
    let page = Page { width: 1000.0, height: 700.0, title, remarks, legend };
    Ok(page.multiples(cells.envelope().into_iter().map(plot).collect()))
}

/// L_u against N_nv at each budget, best over V, with parabolas and minima (Hoffmann et al. 2022, approach 2).
pub fn isoflop_parabolas(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.models.len() < 2 {
        return Err(format!("it needs two model sizes, the runs have {}", cells.models.len()));
    }
    few_enough(cells.budgets.len(), "budgets")?;
    let looks = ordered_looks(cells.budgets.len());
    let minima = minima(sources);
    let mut plot = isoflop_plot(sources, &minima)?;
    for (&budget, &look) in cells.budgets.iter().zip(&looks) {
        for cell in cells.best_of_models(budget) {
            plot.bar(cell.at_its_size(), cell.standard_error, look.colour);
        }
        isoflop(&mut plot, &points(sources, budget), look);
    }
    for minimum in &minima {
        plot.mark(point(minimum), minimum_mark(!minimum.flags.is_empty()));
    }
    let mut legend = Legend::default();
    legend.budgets(&cells.budgets, &looks, sources.held_out_budget(), Look::sample);
    if let Some(first) = minima.first() {
        let marks = [(false, "trusted"), (true, "flagged")].into_iter().filter_map(|(of, text)| {
            let is_there = minima.iter().any(|own| own.flags.is_empty() != of);
            is_there.then(|| (minimum_mark(of), text))
        });
        explain_marks(&mut legend, first.method, marks);
    }
    let hidden = minima.iter().filter(|minimum| !plot.holds(point(minimum))).count();
    let curves = match sources.knows_size_alone() {
        true => "Curves are quadratics in ln N.",
        false => "Each model at its best vocabulary; curves are quadratics in ln Nₙᵥ.",
    };
    let remarks = format!("{curves} {}{}", cells.seeds_remark(true), outside_remark(hidden));
    let title = sources.title("IsoFLOP curves");
    Ok(Page { width: 1000.0, height: 700.0, title, remarks, legend }.panels(vec![plot]))
}

fn isoflop_plot(sources: &Sources, minima: &[&Minimum]) -> Result<Plot, String> {
    let budgets = sources.cells.budgets.iter();
    let all: Vec<Point> = budgets.flat_map(|&budget| points(sources, budget)).collect();
    let [smallest, largest] = ends(&all);
    let inside = minima.iter().filter(|m| (smallest..=largest).contains(&m.params_nonvocab));
    let losses = inside.map(|minimum| minimum.loss_normalised);
    let size_alone = sources.knows_size_alone();
    let loss = sources.loss_axis() + if size_alone { "" } else { ", best over V" };
    let x = Axis::new(quantities(size_alone)[0].label, Scale::Log, all.iter().map(|p| p.0))?;
    let y = Axis::new(&loss, Scale::Linear, all.iter().map(|p| p.1).chain(losses))?;
    Ok(Plot::new([], x, y))
}

/// The minima of the parabolas if the laws have them, else of the laws' own method.
fn minima<'a>(sources: &Sources<'a>) -> Vec<&'a Minimum> {
    let Some(laws) = sources.input.laws else { return Vec::new() };
    let of = |method| laws.minima.iter().filter(move |minimum| minimum.method == method);
    let parabolas: Vec<_> = of(MinimumMethod::Parabola).collect();
    if parabolas.is_empty() { of(laws.minima_method).collect() } else { parabolas }
}

/// One budget: its points, and the parabola through them or, below three sizes, a line.
fn isoflop(plot: &mut Plot, points: &[Point], look: Look) {
    match parabola(points) {
        Some(fit) => plot.curve(ends(points), fit, look.stroke()),
        None => plot.line(points.iter().copied(), Stroke { width: 1.0, ..look.stroke() }),
    }
    plot.marks(points.iter().copied(), look);
}

/// (N_nv, L_u) of each model at a budget, by size.
fn points(sources: &Sources, budget: f64) -> Vec<Point> {
    sources.cells.best_of_models(budget).into_iter().map(CellMean::at_its_size).collect()
}

fn point(minimum: &Minimum) -> Point {
    (minimum.params_nonvocab, minimum.loss_normalised)
}

fn ends(points: &[Point]) -> [f64; 2] {
    span(points.iter().map(|point| point.0))
}

fn minimum_mark(flagged: bool) -> Mark {
    Mark { marker: Marker::Star, colour: INK, radius: 5.0, hollow: flagged }
}

/// The least-squares quadratic in ln x, a + b · u + c · u² of u = ln x − centre; none below three different x.
fn parabola(points: &[Point]) -> Option<impl Fn(f64) -> f64 + use<>> {
    let n = points.len() as f64;
    let centre = points.iter().map(|point| point.0.ln()).sum::<f64>() / n;
    let moment = |k: i32| points.iter().map(|p| (p.0.ln() - centre).powi(k)).sum::<f64>();
    let against = |k: i32| points.iter().map(|p| p.1 * (p.0.ln() - centre).powi(k)).sum::<f64>();
    let moments = Matrix3::from_fn(|row, column| moment((row + column) as i32));
    let right = Vector3::from_fn(|row, _| against(row as i32));
    let scale = moment(0) * moment(2) * moment(4);
    if points.len() < 3 || moments.determinant().abs() <= 1e-12 * scale {
        return None;
    }
    let [a, b, c]: [f64; 3] = moments.lu().solve(&right)?.into();
    Some(move |x: f64| {
        let u = x.ln() - centre;
        a + u * (b + u * c)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_again_from_its_points() {
        let loss = |params: f64| 0.3 * (params.ln() - 11.0).powi(2) - 1.7;
        let points: Vec<_> = [1e4, 3e4, 8e4, 5e5].map(|params| (params, loss(params))).to_vec();
        let fit = parabola(&points).expect("four sizes determine a parabola");
        assert!([2e4, 1e5, 4e5].iter().all(|&x| (fit(x) - loss(x)).abs() < 1e-9));
    }

    #[test]
    fn two_sizes_determine_no_parabola() {
        assert!(parabola(&[(1e4, -1.0), (1e5, -2.0)]).is_none());
        assert!(parabola(&[(1e4, -1.0), (1e5, -2.0), (1e5, -2.1)]).is_none());
    }
}
