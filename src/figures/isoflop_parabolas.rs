//! L_u against N_nv at each budget, best over V, with parabolas and minima
//! (Hoffmann et al. 2022, approach 2).

use nalgebra::{Matrix3, Vector3};

use super::cells::CellMean;
use super::colour::INK;
use super::fitted::{explain_marks, outside_remark};
use super::series::explain_budgets;
use super::words::few_enough;
use super::{
    Axis, Drawing, Legend, Look, Mark, Marker, Page, Plot, Point, Scale, Sources, Stroke,
    ordered_looks,
};
use crate::laws::{Minimum, MinimumMethod};

pub fn draw(sources: &Sources) -> Drawing {
    let cells = &sources.cells;
    if cells.models.len() < 2 {
        return Err(format!("it needs two model sizes, the runs have {}", cells.models.len()));
    }
    few_enough(cells.budgets.len(), "budgets")?;
    let looks = ordered_looks(cells.budgets.len());
    let minima = minima(sources);
    let mut plot = plot(sources, &minima)?;
    for (&budget, &look) in cells.budgets.iter().zip(&looks) {
        for (at, error) in barred(sources, budget) {
            plot.bar(at, error, look.colour);
        }
        isoflop(&mut plot, &points(sources, budget), look);
    }
    for minimum in &minima {
        plot.mark(point(minimum), minimum_mark(!minimum.flags.is_empty()));
    }
    Ok(page(sources, &plot, &minima, &looks).panels(vec![plot]))
}

fn page(sources: &Sources, plot: &Plot, minima: &[&Minimum], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    let budgets = &sources.cells.budgets;
    explain_budgets(&mut legend, budgets, looks, sources.held_out_budget(), Look::sample);
    if let Some(first) = minima.first() {
        let is_there = |flagged| minima.iter().any(|own| own.flags.is_empty() != flagged);
        let marks = [(false, "trusted"), (true, "flagged")].into_iter();
        let marks = marks.filter(|(flagged, _)| is_there(*flagged));
        let marks = marks.map(|(flagged, text)| (minimum_mark(flagged), text));
        explain_marks(&mut legend, first.method, marks);
    }
    let hidden = minima.iter().filter(|minimum| !plot.holds(point(minimum))).count();
    let curves = match sources.knows_size_alone() {
        true => "Curves are quadratics in ln N.",
        false => "Each model at its best vocabulary; curves are quadratics in ln Nₙᵥ.",
    };
    let remarks = format!("{curves} {}{}", sources.cells.bars_remark(), outside_remark(hidden));
    let title = sources.title("IsoFLOP curves");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

fn plot(sources: &Sources, minima: &[&Minimum]) -> Result<Plot, String> {
    let all: Vec<Point> =
        sources.cells.budgets.iter().flat_map(|&budget| points(sources, budget)).collect();
    let (smallest, largest) = ends(&all);
    let inside = minima.iter().filter(|m| (smallest..=largest).contains(&m.params_nonvocab));
    let losses = inside.map(|minimum| minimum.loss_normalised);
    let over = if sources.knows_size_alone() { "" } else { ", best over V" };
    let loss = sources.loss_axis() + over;
    let x = Axis::new(sources.quantities()[0].label, Scale::Log, all.iter().map(|p| p.0))?;
    let y = Axis::new(&loss, Scale::Linear, all.iter().map(|p| p.1).chain(losses))?;
    Ok(Plot::new([], x, y))
}

/// The minima of the parabolas where the laws hold them, else those of the laws' own method.
fn minima<'a>(sources: &Sources<'a>) -> Vec<&'a Minimum> {
    let Some(laws) = sources.input.laws else { return Vec::new() };
    let of = |method| laws.minima.iter().filter(move |minimum| minimum.method == method);
    let parabolas: Vec<_> = of(MinimumMethod::Parabola).collect();
    if parabolas.is_empty() { of(laws.minima_method).collect() } else { parabolas }
}

/// One budget: its points, and the parabola through them or, below three sizes, a line.
fn isoflop(plot: &mut Plot, points: &[Point], look: Look) {
    match parabola(points) {
        Some(fit) => plot.curve(ends(points), |params| fit.at(params), look.stroke()),
        None => plot.line(points.iter().copied(), Stroke { width: 1.0, ..look.stroke() }),
    }
    points.iter().for_each(|at| plot.mark(*at, look.mark()));
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

/// y = a + b · u + c · u², u = ln x − `centre`.
struct Quadratic {
    centre: f64,
    /// a, b and c.
    coefficients: [f64; 3],
}

impl Quadratic {
    fn at(&self, x: f64) -> f64 {
        let u = x.ln() - self.centre;
        let [a, b, c] = self.coefficients;
        a + u * (b + u * c)
    }
}

/// The least-squares quadratic in ln x; none below three different x.
fn parabola(points: &[Point]) -> Option<Quadratic> {
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
    Some(Quadratic { centre, coefficients: moments.lu().solve(&right)?.into() })
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
