//! An axis of a panel: its span, scale, ticks and number format.

use super::style::{Weight, measure};

/// Size of tick labels, in pixels.
pub const TICK_EM: f64 = 12.0;
/// The label of C on an axis.
pub const COMPUTE: &str = "Training compute C (FLOPs)";
/// Space left free beyond the outermost data, as a share of the span.
const PADDING: f64 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Linear,
    Log,
}

impl Scale {
    fn place(self, value: f64) -> f64 {
        match self {
            Scale::Linear => value,
            Scale::Log => value.log10(),
        }
    }
}

/// The least and the largest of some values; of none, infinite and the wrong way round.
pub fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// The direction of an axis; it decides the room of a tick's label.
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
    /// In the unit of the scale: log10 of the value if logarithmic.
    low: f64,
    high: f64,
    /// Ticks at exactly these values, in place of round ones.
    at: Option<Vec<f64>>,
}

impl Axis {
    /// An axis just wide enough for all values; values that it cannot place are ignored.
    ///
    /// # Errors
    ///
    /// It can place no value at all.
    pub fn new(
        label: &str,
        scale: Scale,
        values: impl IntoIterator<Item = f64>,
    ) -> Result<Axis, String> {
        let placed = values.into_iter().map(|value| scale.place(value)).filter(|v| v.is_finite());
        let [low, high] = span(placed);
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

    /// The position of a value: 0 at the low end, 1 at the high end, beyond for values outside.
    pub fn share(&self, value: f64) -> f64 {
        (self.scale.place(value) - self.low) / (self.high - self.low)
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
    pub fn ends(&self) -> [f64; 2] {
        [0.0, 1.0].map(|share| self.value(share))
    }

    pub fn holds(&self, value: f64) -> bool {
        (0.0..=1.0).contains(&self.share(value))
    }

    /// The ticks for an axis `length` pixels long, labelled as densely as the labels fit.
    pub fn ticks(&self, length: f64, direction: Direction) -> Vec<Tick> {
        let fits = |ticks: &[Tick]| self.labels_fit(ticks, length, direction);
        let [low, high] = self.ends();
        match (&self.at, self.scale) {
            (Some(values), _) => self.thinned(values, length, direction),
            (None, Scale::Linear) => linear_ticks(low, high, fits),
            (None, Scale::Log) => log_ticks(low, high, fits),
        }
    }

    /// The width of the widest tick label, in pixels.
    pub fn label_width(&self, length: f64) -> f64 {
        let ticks = self.ticks(length, Direction::Up);
        let widths = ticks.iter().filter_map(|tick| tick.label.as_deref()).map(width);
        widths.fold(0.0, f64::max)
    }

    fn labels_fit(&self, ticks: &[Tick], length: f64, direction: Direction) -> bool {
        let centre = |tick: &Tick| self.share(tick.value) * length;
        let of = |tick| Some(extent(centre(tick), tick.label.as_deref()?, direction));
        let spans: Vec<_> = ticks.iter().filter_map(of).collect();
        spans.windows(2).all(|pair| pair[0].1 <= pair[1].0)
    }

    /// A tick at each value, without labels that would touch the previous one.
    fn thinned(&self, values: &[f64], length: f64, direction: Direction) -> Vec<Tick> {
        let mut end = f64::NEG_INFINITY;
        let mut tick = |&value: &f64| {
            let label = plain(value);
            let (from, to) = extent(self.share(value) * length, &label, direction);
            let free = from >= end;
            end = if free { to } else { end };
            Tick { value, label: free.then_some(label) }
        };
        values.iter().map(&mut tick).collect()
    }
}

fn width(label: &str) -> f64 {
    measure(label, Weight::Normal, TICK_EM)
}

/// The space of a label along its axis, with a margin.
fn extent(centre: f64, label: &str, direction: Direction) -> (f64, f64) {
    let room = match direction {
        Direction::Across => width(label) + 8.0,
        Direction::Up => 1.7 * TICK_EM,
    };
    (centre - room / 2.0, centre + room / 2.0)
}

// Round ticks.

/// A mark on an axis; minor ticks carry no label.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    pub value: f64,
    pub label: Option<String>,
}

/// Sets of labelled multiples of a power of ten, from sparse to dense.
const MULTIPLES: [&[u32]; 6] =
    [&[1], &[1, 3], &[1, 2, 5], &[1, 2, 3, 5], &[1, 2, 3, 4, 6, 8], &[1, 2, 3, 4, 5, 6, 7, 8, 9]];
/// Labels that an axis should carry before denser ones are not asked for.
const ENOUGH: usize = 3;

/// Ticks between `low` and `high` at multiples of powers of ten.
///
/// Takes the sparsest set with [`ENOUGH`] labels that `fits`, else the densest that does; over
/// many decades every n-th is labelled, and within a fraction of one the ticks are linear.
fn log_ticks(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let sets = MULTIPLES.map(|multiples| labelled(low, high, multiples, 1));
    let fitting: Vec<_> = sets.into_iter().filter(|ticks| fits(ticks)).collect();
    let enough = fitting.iter().find(|ticks| ticks.len() >= ENOUGH);
    match enough.or(fitting.last()).cloned() {
        None => {
            // Labels at every n-th decade, for the smallest n that fits.
            let mut sparser = (2..=64).map(|stride| labelled(low, high, &[1], stride));
            with_minor(low, high, sparser.find(|ticks| fits(ticks)).unwrap_or_default())
        }
        Some(best) if best.len() < 2 && high / low < 10.0 => linear_ticks(low, high, fits),
        Some(best) => with_minor(low, high, best),
    }
}

/// The decades of a span, of those that a number can have: an end may be 0 or infinite.
fn decades(low: f64, high: f64) -> std::ops::RangeInclusive<i32> {
    (low.log10().floor() as i32).max(-323)..=(high.log10().ceil() as i32).min(308)
}

fn labelled(low: f64, high: f64, multiples: &[u32], stride: i32) -> Vec<Tick> {
    // Small numbers need no powers of ten.
    let write = if low >= 1.0 && high < 1e5 { plain } else { scientific };
    decades(low, high)
        .filter(|decade| decade % stride == 0)
        .flat_map(|decade| multiples.iter().map(move |&m| f64::from(m) * power(decade)))
        .filter(|value| (low..=high).contains(value))
        .map(|value| Tick { value, label: Some(write(value)) })
        .collect()
}

/// 10^n as its literal reads, which a product of tens would miss by an ulp.
fn power(decade: i32) -> f64 {
    format!("1e{decade}").parse().expect("a power of ten is a number")
}

/// Fills the gaps between labelled ticks with unlabelled ones, fewer over many decades.
fn with_minor(low: f64, high: f64, mut ticks: Vec<Tick>) -> Vec<Tick> {
    let span = decades(low, high);
    let multiples = if span.end() - span.start() > 12 { MULTIPLES[0] } else { MULTIPLES[5] };
    let mut minor = labelled(low, high, multiples, 1);
    minor.retain(|minor| ticks.iter().all(|tick| tick.value != minor.value));
    ticks.extend(minor.into_iter().map(|tick| Tick { label: None, ..tick }));
    ticks
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten: at most eight, fewer if space is short.
fn linear_ticks(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let mut sets = (1..=8).rev().map(|intervals| evenly(low, high, intervals));
    sets.find(|ticks| fits(ticks)).unwrap_or_default()
}

fn evenly(low: f64, high: f64, intervals: u32) -> Vec<Tick> {
    let rough = (high - low) / f64::from(intervals);
    let decade = rough.log10().floor();
    let unit = 10f64.powf(decade);
    let multiple = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * unit >= rough * 0.999);
    let step = multiple.unwrap_or(10.0) * unit;
    let indices = (low / step).ceil() as i64..=(high / step).floor() as i64;
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    // Large values are written as powers of ten.
    let write = |value| if step >= 1e5 { scientific(value) } else { signed(value, decimals) };
    let values = indices.map(|i| i as f64 * step);
    values.map(|value| Tick { value, label: Some(write(value)) }).collect()
}

// Numbers as they are written.

/// A number with a true minus sign.
pub fn signed(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$}").replace('-', "−")
}

/// A whole number in full.
pub fn plain(value: f64) -> String {
    signed(value, 0)
}

/// `10¹⁰`, `3×10¹⁰`, `3.16×10¹⁰`: three digits, no trailing zeros.
pub fn scientific(value: f64) -> String {
    let text = format!("{value:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.').replace('-', "−");
    match (value == 0.0, mantissa.as_str()) {
        (true, _) => "0".to_owned(),
        (_, "1") => format!("10{}", superscript(exponent)),
        _ => format!("{mantissa}×10{}", superscript(exponent)),
    }
}

/// A count of parameters: `790k`, `27.3M`, `1.36B`.
pub fn count(value: f64) -> String {
    let units = [(1e9, "B"), (1e6, "M"), (1e3, "k")];
    let (unit, letter) = units.into_iter().find(|(unit, _)| value >= *unit).unwrap_or((1.0, ""));
    let scaled = value / unit;
    let decimals = if scaled < 9.995 && unit > 1.0 { 2 } else { usize::from(scaled < 99.95) };
    let decimals = if unit == 1.0 { 0 } else { decimals };
    format!("{scaled:.decimals$}{letter}")
}

fn superscript(digits: &str) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    digits.chars().map(raise).collect()
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

    #[test]
    fn powers_of_ten_are_written_without_a_mantissa() {
        assert_eq!(scientific(1e10), "10¹⁰");
        assert_eq!(scientific(3e10), "3×10¹⁰");
        assert_eq!(scientific(3.1623e-7), "3.16×10⁻⁷");
        assert_eq!(scientific(-2.5), "−2.5×10⁰");
    }

    #[test]
    fn counts_carry_three_digits() {
        let written = [27_271_680.0, 790_000.0, 1_359_103_488.0, 512.0, 9_996.0].map(count);
        assert_eq!(written, ["27.3M", "790k", "1.36B", "512", "10.0k"]);
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let labels: Vec<_> = linear_ticks(-1.93, -0.41, |_| true)
            .into_iter()
            .filter_map(|tick| tick.label)
            .collect();
        assert_eq!(labels, ["−1.8", "−1.6", "−1.4", "−1.2", "−1.0", "−0.8", "−0.6"]);
    }

    #[test]
    fn an_axis_over_all_numbers_has_no_more_ticks_than_decades() {
        let axis = Axis::new("N", Scale::Log, [1e-320, f64::MAX]).unwrap();
        assert_eq!(axis.ends(), [0.0, f64::INFINITY]);
        let ticks = axis.ticks(300.0, Direction::Up);
        assert!((2..640).contains(&ticks.len()), "{}", ticks.len());
    }
}
