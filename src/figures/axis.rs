//! A quantity along one side of a panel: its span, its scale, its ticks.

use super::font::{Weight, measure};
use super::ticks::{self, Tick};

/// Size of tick labels, in pixels.
pub const TICK_EM: f64 = 12.0;
/// What C is called along an axis.
pub const COMPUTE: &str = "Training compute C (FLOPs)";
/// Space left free beyond the outermost data, as a share of the span.
const PADDING: f64 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Linear,
    Log,
}

/// Which way an axis runs; it decides how much room a tick's label takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Across,
    Up,
}

/// A labelled span of values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    pub label: String,
    scale: Scale,
    /// In the scale's own unit: log10 of the value where it is logarithmic.
    low: f64,
    high: f64,
    /// Ticks at exactly these values, in place of round ones.
    at: Option<Vec<f64>>,
}

impl Axis {
    /// An axis just wide enough for all values; what it cannot place is passed over.
    ///
    /// # Errors
    ///
    /// The reason why there is no axis, where it can place no value at all.
    pub fn new(
        label: &str,
        scale: Scale,
        values: impl IntoIterator<Item = f64>,
    ) -> Result<Axis, String> {
        let placed = values.into_iter().map(|value| place(scale, value)).filter(|v| v.is_finite());
        let (low, high) =
            placed.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            return Err(format!("no value of {label} can be placed on an axis"));
        }
        // A single value sits in the middle of a span that still has round ticks.
        let margin = if high > low { (high - low) * PADDING } else { 0.1 * low.abs().max(1.0) };
        let (label, low, high) = (label.to_owned(), low - margin, high + margin);
        Ok(Axis { label, scale, low, high, at: None })
    }

    /// Puts the ticks at these values, which then are labelled in full.
    pub fn ticks_at(self, values: impl IntoIterator<Item = f64>) -> Axis {
        Axis { at: Some(values.into_iter().collect()), ..self }
    }

    /// Where a value lies, 0 at the low end and 1 at the high end; beyond for values outside.
    pub fn share(&self, value: f64) -> f64 {
        (place(self.scale, value) - self.low) / (self.high - self.low)
    }

    /// The value at a share of the axis.
    pub fn value(&self, share: f64) -> f64 {
        let placed = self.low + share * (self.high - self.low);
        match self.scale {
            Scale::Linear => placed,
            Scale::Log => 10f64.powf(placed),
        }
    }

    /// The values at both ends.
    pub fn ends(&self) -> (f64, f64) {
        (self.value(0.0), self.value(1.0))
    }

    pub fn holds(&self, value: f64) -> bool {
        (0.0..=1.0).contains(&self.share(value))
    }

    /// The ticks for an axis `length` pixels long, labelled as densely as the labels fit.
    pub fn ticks(&self, length: f64, direction: Direction) -> Vec<Tick> {
        let fits = |ticks: &[Tick]| self.labels_fit(ticks, length, direction);
        let (low, high) = self.ends();
        match (&self.at, self.scale) {
            (Some(values), _) => self.thinned(values, length, direction),
            (None, Scale::Linear) => ticks::linear(low, high, fits),
            (None, Scale::Log) => ticks::log(low, high, fits),
        }
    }

    /// The width of the widest tick label, in pixels.
    pub fn label_width(&self, length: f64) -> f64 {
        let ticks = self.ticks(length, Direction::Up);
        let widths = ticks.iter().filter_map(|tick| tick.label.as_deref()).map(width);
        widths.fold(0.0, f64::max)
    }

    fn labels_fit(&self, ticks: &[Tick], length: f64, direction: Direction) -> bool {
        let labelled = ticks.iter().filter_map(|tick| Some((tick.value, tick.label.as_deref()?)));
        let spans: Vec<_> = labelled
            .map(|(value, label)| extent(self.share(value) * length, label, direction))
            .collect();
        spans.windows(2).all(|pair| pair[0].1 <= pair[1].0)
    }

    /// A tick at each value, labels dropped where they would touch the one before.
    fn thinned(&self, values: &[f64], length: f64, direction: Direction) -> Vec<Tick> {
        let mut end = f64::NEG_INFINITY;
        let mut tick = |&value: &f64| {
            let label = ticks::plain(value);
            let (from, to) = extent(self.share(value) * length, &label, direction);
            let free = from >= end;
            end = if free { to } else { end };
            Tick { value, label: free.then_some(label) }
        };
        values.iter().map(&mut tick).collect()
    }
}

fn place(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Log => value.log10(),
    }
}

fn width(label: &str) -> f64 {
    measure(label, Weight::Normal, TICK_EM)
}

/// What a label takes along its axis, with some air.
fn extent(centre: f64, label: &str, direction: Direction) -> (f64, f64) {
    let room = match direction {
        Direction::Across => width(label) + 8.0,
        Direction::Up => 1.7 * TICK_EM,
    };
    (centre - room / 2.0, centre + room / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, length: f64) -> Vec<String> {
        axis.ticks(length, Direction::Across).into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn a_wide_span_is_labelled_by_decades() {
        let axis = Axis::new("C", Scale::Log, [1e10, 1e13]).unwrap();
        assert_eq!(labels(&axis, 500.0), ["10¹⁰", "10¹¹", "10¹²", "10¹³"]);
    }

    #[test]
    fn a_span_within_a_decade_still_gets_labels() {
        let axis = Axis::new("C", Scale::Log, [1.2e10, 4.1e10]).unwrap();
        assert_eq!(labels(&axis, 500.0), ["2×10¹⁰", "3×10¹⁰", "4×10¹⁰"]);
        let narrow = Axis::new("C", Scale::Log, [1.01e10, 1.13e10]).unwrap();
        assert!(labels(&narrow, 500.0).len() >= 2);
    }

    #[test]
    fn labels_never_overlap_however_short_the_axis() {
        for length in [60.0, 120.0, 300.0, 900.0] {
            for (scale, low, high) in
                [(Scale::Log, 3e4, 8e6), (Scale::Log, 1.0, 1e30), (Scale::Linear, -2.0, -0.3)]
            {
                let axis = Axis::new("x", scale, [low, high]).unwrap();
                let ticks = axis.ticks(length, Direction::Across);
                assert!(axis.labels_fit(&ticks, length, Direction::Across), "{length} {axis:?}");
            }
        }
    }

    #[test]
    fn a_value_comes_back_from_its_share() {
        let axis = Axis::new("x", Scale::Log, [1e3, 1e9]).unwrap();
        assert!((axis.value(axis.share(5e7)) / 5e7 - 1.0).abs() < 1e-12);
        assert!(axis.holds(1e3) && !axis.holds(1.0));
    }

    #[test]
    fn what_cannot_be_placed_makes_no_axis() {
        assert!(Axis::new("x", Scale::Log, [0.0, -1.0, f64::NAN]).is_err());
        let axis = Axis::new("x", Scale::Log, [0.0, 10.0, 1e3]).unwrap();
        assert!(axis.holds(10.0) && !axis.holds(0.0));
    }
}
