//! [`largest`]: the sweep that takes the time that there is.

use anyhow::Result;

use super::design::Design;

/// The largest budget of the smallest sweep that is offered, FLOPs.
pub const LEAST: f64 = 1.6e10;
/// Budgets that are tried of each doubling of it.
const STEPS: i32 = 8;
/// The last budget tried: 33 million times the first.
const LAST: i32 = 25 * STEPS;
/// Larger budgets that are looked at behind the largest found: hours do not grow with each step.
const LOOK_AHEAD: i32 = 2 * STEPS;
/// Seeds of runs and of tokenizers, in the order in which time is spent on them.
const SEEDS: [[u64; 2]; 4] = [[1, 1], [2, 1], [3, 1], [3, 3]];
/// With these the noise of runs is measured, and the rest of the time goes to larger budgets.
const MEASURED: [u64; 2] = SEEDS[1];

/// Fewer hours that are looked at, each a fifth below the last: a thousandth at least.
const FEWER: i32 = 30;

/// Share of the hours that a sweep may take by the estimate, which is not exact.
const SPENT: f64 = 0.93;

/// What a sweep takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    pub hours: f64,
    pub runs: usize,
}

/// A sweep that fits.
#[derive(Debug)]
pub struct Offer {
    pub design: Design,
    pub price: Price,
}

/// What sweeps are made of and measured by.
pub struct Terms<'a> {
    pub hours: f64,
    /// Codes of the training split; `None` where they have no end.
    pub unique_tokens: Option<usize>,
    /// Times that the expected optimum of the largest budget may see the data, while there is better to do.
    pub epochs: f64,
    pub price: &'a dyn Fn(&Design) -> Result<Price>,
}

impl Terms<'_> {
    /// The largest sweep within the time. Time goes to a second seed of each run, to larger budgets for as long as
    /// the data are new, to further seeds of runs and tokenizers, and then to budgets that repeat the data.
    ///
    /// # Errors
    /// A sweep cannot be priced.
    pub fn largest(&self) -> Result<Offer> {
        let fresh = (0..=LAST).rev().find(|step| self.is_fresh(*step)).unwrap_or(0);
        let seeds = if self.fits(0, MEASURED)? { MEASURED } else { SEEDS[0] };
        let step = self.search(0, fresh, seeds)?;
        if step < fresh {
            return self.offer(step, seeds);
        }
        let mut most = seeds;
        for more in SEEDS {
            if self.fits(fresh, more)? {
                most = more;
            }
        }
        self.offer(self.search(fresh, LAST, most)?, most)
    }

    /// The most of fewer hours whose offer does not repeat the data beyond measure, in two digits; `None`
    /// where none does.
    ///
    /// # Errors
    /// A sweep cannot be priced.
    pub fn fresh_hours(&self) -> Result<Option<f64>> {
        for step in 1..=FEWER {
            let hours = format!("{:.1e}", self.hours * 0.8f64.powi(step));
            let hours = hours.parse().expect("a number was written");
            if self.bears(&Self { hours, ..*self }.largest()?.design) {
                return Ok(Some(hours));
            }
        }
        Ok(None)
    }

    fn design(&self, step: i32) -> Design {
        Design::up_to(LEAST * 2f64.powf(f64::from(step) / f64::from(STEPS)), self.unique_tokens)
    }

    fn is_fresh(&self, step: i32) -> bool {
        self.bears(&self.design(step))
    }

    /// Whether the data bear the sweep.
    fn bears(&self, design: &Design) -> bool {
        let epochs = |unique: usize| design.most_tokens() / unique as f64;
        self.unique_tokens.map(epochs).is_none_or(|epochs| epochs <= self.epochs)
    }

    fn fits(&self, step: i32, seeds: [u64; 2]) -> Result<bool> {
        Ok((self.price)(&self.design(step).with_seeds(seeds))?.hours <= SPENT * self.hours)
    }

    /// The largest step that fits, between two of which the first does or is the least there is.
    fn search(&self, least: i32, most: i32, seeds: [u64; 2]) -> Result<i32> {
        let (mut low, mut high) = (least, most);
        while low < high {
            let middle = (low + high + 1) / 2;
            if self.fits(middle, seeds)? {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        for step in (low + 1..=most.min(low + LOOK_AHEAD)).rev() {
            if self.fits(step, seeds)? {
                return Ok(step);
            }
        }
        Ok(low)
    }

    fn offer(&self, step: i32, seeds: [u64; 2]) -> Result<Offer> {
        let design = self.design(step).with_seeds(seeds);
        let price = (self.price)(&design)?;
        Ok(Offer { design, price })
    }
}
