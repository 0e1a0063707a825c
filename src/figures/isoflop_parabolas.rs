//! L_u against N_nv at each budget, best over V, with parabolas and minima
//! (Hoffmann et al. 2022, approach 2).

use crate::laws::{Laws, Minimum, MinimumMethod};

use super::axis::{Axis, Scale};
use super::cells::CellMean;
use super::colour::INK;
use super::fitted::outside_remark;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Mark, Marker, Point, Scene, Stroke};
use super::series::{Look, explain_budgets, ordered_looks};
use super::words::few_enough;
use super::{Drawing, Sources};

pub fn draw(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.models.len() < 2 {
        return Err(format!("it needs two model sizes, the runs have {}", cells.models.len()));
    }
    few_enough(cells.budgets.len(), "budgets")?;
    let looks = ordered_looks(cells.budgets.len());
    let plot = plot(sources)?;
    let minima = minima(sources);
    let page = page(sources, &plot, &minima, &looks);
    let (mut scene, panels) = page.panels(vec![plot]);
    panels[0].backdrop(&mut scene);
    for (&budget, &look) in cells.budgets.iter().zip(&looks) {
        for (at, error) in barred(sources, budget) {
            panels[0].bar(&mut scene, at, error, look.colour);
        }
        isoflop(&mut scene, &panels[0], &points(sources, budget), look);
    }
    for minimum in minima {
        panels[0].mark(&mut scene, point(minimum), minimum_mark(!minimum.flags.is_empty()));
    }
    Ok(scene)
}

fn page(sources: &Sources, plot: &Plot, minima: &[&Minimum], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    let budgets = &sources.cells.budgets;
    explain_budgets(&mut legend, budgets, looks, sources.held_out_budget(), Look::sample);
    explain_minima(&mut legend, minima);
    let shown = |minimum: &&&Minimum| {
        plot.x.holds(minimum.params_nonvocab) && plot.y.holds(minimum.loss_normalised)
    };
    let hidden = minima.len() - minima.iter().filter(shown).count();
    let curves = match sources.knows_size_alone() {
        true => "Curves are quadratics in ln N.",
        false => "Each model at its best vocabulary; curves are quadratics in ln Nₙᵥ.",
    };
    let remarks = format!("{curves} {}{}", sources.cells.bars_remark(), outside_remark(hidden));
    let title = sources.title("IsoFLOP curves");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

fn explain_minima(legend: &mut Legend, minima: &[&Minimum]) {
    let Some(first) = minima.first() else { return };
    legend.heading(&format!("Minima ({})", first.method));
    for (flagged, text) in [(false, "trusted"), (true, "flagged")] {
        if minima.iter().any(|minimum| minimum.flags.is_empty() != flagged) {
            legend.entry(Sample::Mark(minimum_mark(flagged)), text);
        }
    }
}

fn plot(sources: &Sources) -> Result<Plot, String> {
    let all: Vec<Point> =
        sources.cells.budgets.iter().flat_map(|&budget| points(sources, budget)).collect();
    let minima = minima(sources);
    let (smallest, largest) = ends(&all);
    let inside = minima.iter().filter(|m| (smallest..=largest).contains(&m.params_nonvocab));
    let losses = inside.map(|minimum| minimum.loss_normalised);
    let over = if sources.knows_size_alone() { "" } else { ", best over V" };
    let loss = sources.loss_axis() + over;
    Ok(Plot {
        title: Vec::new(),
        x: Axis::new(sources.size_axis(), Scale::Log, all.iter().map(|p| p.0))?,
        y: Axis::new(&loss, Scale::Linear, all.iter().map(|p| p.1).chain(losses))?,
    })
}

/// The minima of the parabolas where the laws hold them, else those of the laws' own method.
fn minima<'a>(sources: &Sources<'a>) -> Vec<&'a Minimum> {
    let Some(laws) = sources.input.laws else { return Vec::new() };
    let of = |method| move |minimum: &&Minimum| minimum.method == method;
    let parabola = of(MinimumMethod::Parabola);
    let method = shown_method(laws, laws.minima.iter().any(|minimum| parabola(&minimum)));
    laws.minima.iter().filter(of(method)).collect()
}

fn shown_method(laws: &Laws, has_parabolas: bool) -> MinimumMethod {
    if has_parabolas { MinimumMethod::Parabola } else { laws.minima_method }
}

/// One budget: its points, and the parabola through them or, below three sizes, a line.
fn isoflop(scene: &mut Scene, panel: &Panel, points: &[Point], look: Look) {
    match parabola(points) {
        Some(fit) => panel.curve(scene, ends(points), |params| fit.at(params), look.stroke()),
        None => panel.line(scene, points, Stroke { width: 1.0, ..look.stroke() }),
    }
    for &at in points {
        panel.mark(scene, at, look.mark());
    }
}

/// (N_nv, L_u) of each model at a budget, by size, and the standard error of L_u.
fn barred(sources: &Sources, budget: f64) -> Vec<(Point, Option<f64>)> {
    let best = sources.cells.best_of_models(budget);
    let at = |cell: &CellMean| (cell.model.params_nonvocab as f64, cell.loss_normalised);
    best.iter().map(|cell| (at(cell), cell.standard_error)).collect()
}

fn points(sources: &Sources, budget: f64) -> Vec<Point> {
    barred(sources, budget).into_iter().map(|(at, _)| at).collect()
}

fn point(minimum: &Minimum) -> Point {
    (minimum.params_nonvocab, minimum.loss_normalised)
}

fn ends(points: &[Point]) -> (f64, f64) {
    let sizes = points.iter().map(|point| point.0);
    sizes.fold((f64::INFINITY, 0.0), |(low, high), size| (low.min(size), high.max(size)))
}

fn minimum_mark(flagged: bool) -> Mark {
    Mark { marker: Marker::Star, colour: INK, radius: 5.0, hollow: flagged }
}

/// y = `constant` + `linear` · u + `quadratic` · u², u = ln x − `centre`.
struct Quadratic {
    centre: f64,
    constant: f64,
    linear: f64,
    quadratic: f64,
}

impl Quadratic {
    fn at(&self, x: f64) -> f64 {
        let u = x.ln() - self.centre;
        self.constant + u * (self.linear + u * self.quadratic)
    }
}

/// The least-squares quadratic in ln x; none below three different x.
fn parabola(points: &[Point]) -> Option<Quadratic> {
    let n = points.len() as f64;
    let centre = points.iter().map(|point| point.0.ln()).sum::<f64>() / n;
    let moment = |k: i32| points.iter().map(|p| (p.0.ln() - centre).powi(k)).sum::<f64>();
    let against = |k: i32| points.iter().map(|p| p.1 * (p.0.ln() - centre).powi(k)).sum::<f64>();
    let columns = [0, 1, 2].map(|k| [0, 1, 2].map(|row| moment(k + row)));
    let right = [0, 1, 2].map(against);
    let whole = determinant(columns);
    let scale = moment(0) * moment(2) * moment(4);
    if points.len() < 3 || whole.abs() <= 1e-12 * scale {
        return None;
    }
    let cramer = |k: usize| {
        let mut replaced = columns;
        replaced[k] = right;
        determinant(replaced) / whole
    };
    Some(Quadratic { centre, constant: cramer(0), linear: cramer(1), quadratic: cramer(2) })
}

fn determinant([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1])
        + c[0] * (a[1] * b[2] - a[2] * b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_again_from_its_points() {
        let loss = |params: f64| 0.3 * (params.ln() - 11.0).powi(2) - 1.7;
        let points: Vec<_> = [1e4, 3e4, 8e4, 5e5].map(|params| (params, loss(params))).to_vec();
        let fit = parabola(&points).expect("four sizes determine a parabola");
        assert!([2e4, 1e5, 4e5].iter().all(|&x| (fit.at(x) - loss(x)).abs() < 1e-9));
    }

    #[test]
    fn two_sizes_determine_no_parabola() {
        assert!(parabola(&[(1e4, -1.0), (1e5, -2.0)]).is_none());
        assert!(parabola(&[(1e4, -1.0), (1e5, -2.0), (1e5, -2.1)]).is_none());
    }
}
