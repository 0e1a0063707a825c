//! The budgets that are fitted, and the one that is not.

use super::budget::is_same_budget;
use super::{Budget, FitOptions, HeldOut, Minimum, MinimumMethod, minima};

/// A table's budgets, parted once at the start of a fit.
pub(super) struct Split<'a> {
    pub fitted: Vec<Budget<'a>>,
    pub held_out: Option<Budget<'a>>,
}

impl<'a> Split<'a> {
    pub fn new(mut budgets: Vec<Budget<'a>>, held_out: Option<usize>) -> Self {
        let held_out = held_out.map(|index| budgets.remove(index));
        Self { fitted: budgets, held_out }
    }

    /// Every method asked for, and those that the choice of the laws' method needs, with the
    /// minima of the fitted budgets.
    pub fn minima_by_method(&self, options: &FitOptions) -> Vec<(MinimumMethod, Vec<Minimum>)> {
        let mut methods = options.methods.clone();
        match options.law_method {
            Some(method) => methods.push(method),
            None => methods.extend([MinimumMethod::Argmin, MinimumMethod::Parabola]),
        }
        methods.sort();
        methods.dedup();
        methods.into_iter().map(|method| (method, minima(method, &self.fitted))).collect()
    }

    /// The minimum measured at the held-out budget. The noise that its flags are judged by is
    /// pooled over all budgets, as for the others.
    pub fn held_out_minimum(&self, method: MinimumMethod) -> Option<HeldOut> {
        let budget = self.held_out.as_ref()?;
        let all: Vec<_> = self.fitted.iter().chain([budget]).cloned().collect();
        let minimum = minima(method, &all).pop()?;
        Some(HeldOut { budget_flops: budget.budget_flops, minimum })
    }

    /// The fitted budgets that these minima belong to.
    pub fn only(&self, minima: &[Minimum]) -> Vec<Budget<'a>> {
        let kept =
            |b: &&Budget| minima.iter().any(|m| is_same_budget(m.budget_flops, b.budget_flops));
        self.fitted.iter().filter(kept).cloned().collect()
    }

    /// How many vocabularies the fitted budgets tried.
    pub fn n_vocabularies(&self) -> usize {
        let points = self.fitted.iter().flat_map(|b| &b.points);
        let mut tried: Vec<f64> = points.map(|p| p.n_vocab).collect();
        tried.sort_by(f64::total_cmp);
        tried.dedup();
        tried.len()
    }
}
