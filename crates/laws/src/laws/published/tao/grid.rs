//! Runs as a full grid of models, vocabularies and checkpoints.

use super::FrontierError;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats::distinct;

/// How far the last checkpoints of one model may differ in tokens, relatively.
const SAME_TOKENS: f64 = 1e-6;

/// Runs by model, in it by vocabulary, in that by tokens, each ascending.
#[derive(Debug)]
pub(super) struct Grid<'a> {
    /// N_nv.
    pub models: Vec<f64>,
    /// V.
    pub vocabularies: Vec<f64>,
    pub checkpoints: usize,
    pub runs: Vec<&'a IsoFlopPoint>,
}

impl<'a> Grid<'a> {
    /// The grid that the runs fill, in whatever order they come.
    pub fn new(points: &'a [IsoFlopPoint]) -> Result<Self, FrontierError> {
        let mut runs: Vec<&IsoFlopPoint> = points.iter().collect();
        let order = |of: fn(&IsoFlopPoint) -> f64| {
            move |a: &&IsoFlopPoint, b: &&IsoFlopPoint| of(a).total_cmp(&of(b))
        };
        // Each sort keeps the order of the one before within what it finds alike.
        runs.sort_by(order(|run| run.tokens));
        runs.sort_by(order(|run| run.n_vocab));
        runs.sort_by(order(|run| run.params_nonvocab));
        let models = distinct(runs.iter().map(|run| run.params_nonvocab));
        let vocabularies = distinct(runs.iter().map(|run| run.n_vocab));
        let cells = runs.chunk_by(|a, b| same_cell(a, b.params_nonvocab, b.n_vocab));
        let checkpoints = cells.map(<[_]>::len).max().unwrap_or(0);
        let grid = Self { models, vocabularies, checkpoints, runs };
        grid.check_size()?;
        grid.check_cells()?;
        Ok(grid)
    }

    /// The checkpoints of one model at one vocabulary.
    pub fn cell(&self, model: usize, vocabulary: usize) -> &[&'a IsoFlopPoint] {
        let start = (model * self.vocabularies.len() + vocabulary) * self.checkpoints;
        &self.runs[start..start + self.checkpoints]
    }

    /// The last checkpoint of one model at one vocabulary.
    pub fn last(&self, model: usize, vocabulary: usize) -> &'a IsoFlopPoint {
        self.cell(model, vocabulary)[self.checkpoints - 1]
    }

    fn check_size(&self) -> Result<(), FrontierError> {
        let [models, vocabularies] = [self.models.len(), self.vocabularies.len()];
        let checkpoints = self.checkpoints;
        let enough = models >= 2 && vocabularies >= 3 && checkpoints >= 2;
        enough.then_some(()).ok_or(FrontierError::TooSmall { models, vocabularies, checkpoints })
    }

    fn check_cells(&self) -> Result<(), FrontierError> {
        let cells = |check: &dyn Fn(usize, usize) -> Result<(), String>| {
            for (m, n) in self.models.iter().enumerate() {
                for (v, n_vocab) in self.vocabularies.iter().enumerate() {
                    check(m, v).map_err(|what| {
                        let place = format!("the model of {n} at V = {n_vocab}");
                        FrontierError::NotAGrid(format!("{place} {what}"))
                    })?;
                }
            }
            Ok(())
        };
        // Only once every cell is as large as the next does each start where it should.
        cells(&|m, v| self.check_count(m, v))?;
        cells(&|m, v| self.check_tokens(m, v))
    }

    fn check_count(&self, model: usize, vocabulary: usize) -> Result<(), String> {
        let (n, n_vocab) = (self.models[model], self.vocabularies[vocabulary]);
        let found = self.runs.iter().filter(|run| same_cell(run, n, n_vocab)).count();
        let expected = self.checkpoints;
        let full = found == expected;
        full.then_some(())
            .ok_or_else(|| format!("has {found} checkpoint(s) where others have {expected}"))
    }

    fn check_tokens(&self, model: usize, vocabulary: usize) -> Result<(), String> {
        let cell = self.cell(model, vocabulary);
        if cell.windows(2).any(|pair| pair[0].tokens == pair[1].tokens) {
            return Err("has two checkpoints of the same tokens".into());
        }
        let [last, first] = [self.last(model, vocabulary), self.last(model, 0)].map(|r| r.tokens);
        let same = (last / first - 1.0).abs() <= SAME_TOKENS;
        same.then_some(()).ok_or_else(|| {
            format!("ends at {last} tokens, and at {first} with the smallest vocabulary")
        })
    }
}

fn same_cell(run: &IsoFlopPoint, params_nonvocab: f64, n_vocab: f64) -> bool {
    run.params_nonvocab == params_nonvocab && run.n_vocab == n_vocab
}
