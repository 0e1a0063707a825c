//! Points between the runs, as Tao et al. made them for their frontier.

mod clough_tocher;
mod gradients;
mod mesh;
mod spline;

use super::grid::Grid;
use super::{FrontierError, FrontierPoint, TokensPerCharacter, published_width};
use crate::laws::input::point::IsoFlopPoint;
pub(super) use gradients::Stop;
use mesh::Mesh;
use spline::Spline;

/// Points of the path through models and characters, and of that through vocabularies, the ends
/// counted. The ends are runs themselves or lie outside them, so they are left out.
const ALONG_SIZES: usize = 50;
const ALONG_VOCABULARIES: usize = 20;

/// Every interpolated point: for each vocabulary those between its models and checkpoints, then
/// for each model those between its vocabularies.
pub(super) fn between(grid: &Grid, stop: Stop) -> Result<Vec<FrontierPoint>, FrontierError> {
    let mut points = Vec::new();
    for vocabulary in 0..grid.vocabularies.len() {
        points.extend(between_sizes(grid, vocabulary, stop)?);
    }
    for model in 0..grid.models.len() {
        points.extend(between_vocabularies(grid, model)?);
    }
    Ok(points)
}

/// Points of one vocabulary at N_nv and H that grow together from the least to the greatest of
/// all runs, evenly in logarithms; those outside the vocabulary's own runs are dropped.
fn between_sizes(
    grid: &Grid,
    vocabulary: usize,
    stop: Stop,
) -> Result<Vec<FrontierPoint>, FrontierError> {
    let n_vocab = grid.vocabularies[vocabulary];
    let f = TokensPerCharacter::TAO.at(n_vocab);
    let runs = || (0..grid.models.len()).flat_map(|model| grid.cell(model, vocabulary));
    let places = runs().map(|run| [run.params_nonvocab, run.tokens / f]).collect();
    let losses: Vec<f64> = runs().map(|run| run.loss).collect();
    let mesh = Mesh::new(places)?;
    let slopes = gradients::estimate(&mesh, &losses, stop);
    let loss_at = |place| clough_tocher::value(&mesh, &losses, &slopes, place);
    path(grid)
        .filter_map(|[n, h]| Some((n, h * f, loss_at([n, h])?)))
        .map(|(n, tokens, loss)| point(n, n_vocab, tokens, loss))
        .collect()
}

/// (N_nv, H) along the path.
fn path(grid: &Grid) -> impl Iterator<Item = [f64; 2]> {
    let characters = |run: &&IsoFlopPoint| run.tokens / TokensPerCharacter::TAO.at(run.n_vocab);
    let along = |least: f64, most: f64| inside(least, most, ALONG_SIZES);
    let (least, most) = range(grid.runs.iter().map(characters));
    let (smallest, largest) = range(grid.models.iter().copied());
    along(smallest, largest).zip(along(least, most)).map(|(n, h)| [n, h])
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0), |(low, high), value| (low.min(value), high.max(value)))
}

/// Points of one model at vocabularies between those tried, each at the model's last checkpoint.
fn between_vocabularies(grid: &Grid, model: usize) -> Result<Vec<FrontierPoint>, FrontierError> {
    let last = |v| grid.last(model, v);
    let losses: Vec<f64> = (0..grid.vocabularies.len()).map(|v| last(v).loss).collect();
    let spline = Spline::through(&grid.vocabularies, &losses)
        .ok_or_else(|| FrontierError::NotAGrid("two vocabularies are too near".into()))?;
    let (smallest, largest) = range(grid.vocabularies.iter().copied());
    inside(smallest, largest, ALONG_VOCABULARIES)
        .map(|v| point(grid.models[model], v, last(0).tokens, spline.at(v)))
        .collect()
}

/// The numbers strictly between two of `count` evenly spread in logarithms.
fn inside(first: f64, last: f64, count: usize) -> impl Iterator<Item = f64> {
    let (from, to) = (first.ln(), last.ln());
    (1..count - 1).map(move |k| (from + (to - from) * k as f64 / (count - 1) as f64).exp())
}

fn point(
    params_nonvocab: f64,
    n_vocab: f64,
    tokens: f64,
    loss: f64,
) -> Result<FrontierPoint, FrontierError> {
    let d = published_width(params_nonvocab).ok_or(FrontierError::NoWidth { params_nonvocab })?;
    let params_vocab = n_vocab * d;
    let flops = 6.0 * (params_nonvocab + params_vocab) * tokens;
    Ok(FrontierPoint { flops, params_nonvocab, params_vocab, n_vocab, loss_normalised: loss })
}

#[cfg(test)]
mod tests {
    use super::super::runs;
    use super::*;

    /// scipy 1.17: vocabulary, place among its points, loss.
    const BETWEEN_SIZES: [(usize, usize, f64); 6] = [
        (0, 0, -1.4962393327378738),
        (0, 20, -4.208282206818234),
        (0, 43, -3.9304969277853887),
        (5, 10, -3.020292951621216),
        (9, 30, -4.739273333737988),
        (9, 43, -5.185101207754137),
    ];
    /// scipy 1.17: model, place among its points, loss.
    const BETWEEN_VOCABULARIES: [(usize, usize, f64); 6] = [
        (0, 0, -3.944630863394993),
        (0, 9, -3.9192891006879393),
        (0, 17, -3.855165976174084),
        (5, 0, -5.157828980504684),
        (5, 9, -5.273332003859808),
        (5, 17, -5.251085043008795),
    ];

    #[test]
    fn the_points_between_the_published_runs_are_scipys() {
        let Some(runs) = runs::published() else { return };
        let grid = Grid::new(&runs).unwrap();
        let sizes = |v| between_sizes(&grid, v, Stop::PUBLISHED).unwrap();
        let loss_off = |points: Vec<FrontierPoint>, place: usize, loss: f64| {
            (points[place].loss_normalised - loss).abs()
        };
        assert_eq!((0..10).map(|v| sizes(v).len()).sum::<usize>(), 440);
        for (v, place, loss) in BETWEEN_SIZES {
            assert!(loss_off(sizes(v), place, loss) < 1e-12, "V {v}, point {place}");
        }
        for (m, place, loss) in BETWEEN_VOCABULARIES {
            let points = between_vocabularies(&grid, m).unwrap();
            assert_eq!(points.len(), 18);
            assert!(loss_off(points, place, loss) < 1e-12, "model {m}, point {place}");
        }
    }

    #[test]
    fn the_path_leaves_out_its_ends() {
        let inner: Vec<f64> = inside(1.0, 10_000.0, 5).collect();
        assert!(inner.iter().zip([10.0, 100.0, 1000.0]).all(|(x, y)| (x / y - 1.0).abs() < 1e-12));
        assert_eq!(inner.len(), 3);
    }
}
