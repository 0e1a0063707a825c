//! Round ticks and how their values are written.

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
/// Minor ticks are left away on an axis of more decades than this.
const MINOR_DECADES: i32 = 12;

/// Ticks between `low` and `high` at multiples of powers of ten.
///
/// Takes the sparsest set with [`ENOUGH`] labels that `fits`, else the densest that does; over
/// many decades every n-th is labelled, and within a fraction of one the ticks are linear.
pub fn log(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let sets = MULTIPLES.map(|multiples| labelled(low, high, multiples, 1));
    let fitting: Vec<_> = sets.into_iter().filter(|ticks| fits(ticks)).collect();
    let enough = fitting.iter().find(|ticks| ticks.len() >= ENOUGH);
    match enough.or(fitting.last()).cloned() {
        None => strided(low, high, fits),
        Some(best) if best.len() < 2 && high / low < 10.0 => linear(low, high, fits),
        Some(best) => with_minor(low, high, best),
    }
}

/// Labels at every n-th decade, for the smallest n that fits.
fn strided(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let sparser = (2..=64).map(|stride| labelled(low, high, &[1], stride));
    let found = sparser.into_iter().find(|ticks| fits(ticks));
    with_minor(low, high, found.unwrap_or_default())
}

fn decades(low: f64, high: f64) -> std::ops::RangeInclusive<i32> {
    low.log10().floor() as i32..=high.log10().ceil() as i32
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

/// Fills the gaps between labelled ticks with unlabelled ones.
fn with_minor(low: f64, high: f64, mut ticks: Vec<Tick>) -> Vec<Tick> {
    let span = decades(low, high);
    let crowded = span.end() - span.start() > MINOR_DECADES;
    let multiples = if crowded { MULTIPLES[0] } else { MULTIPLES[5] };
    let minor = labelled(low, high, multiples, 1).into_iter();
    let free: Vec<_> = minor.filter(|m| ticks.iter().all(|t| t.value != m.value)).collect();
    ticks.extend(free.into_iter().map(|tick| Tick { label: None, ..tick }));
    ticks
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten: at most eight, fewer where they must fit.
pub fn linear(low: f64, high: f64, fits: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
    let sets = (1..=8).rev().map(|intervals| evenly(low, high, intervals));
    sets.into_iter().find(|ticks| fits(ticks)).unwrap_or_default()
}

fn evenly(low: f64, high: f64, intervals: u32) -> Vec<Tick> {
    let rough = (high - low) / f64::from(intervals);
    let decade = rough.log10().floor();
    let unit = 10f64.powf(decade);
    let multiple = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * unit >= rough * 0.999);
    let step = multiple.unwrap_or(10.0) * unit;
    let indices = (low / step).ceil() as i64..=(high / step).floor() as i64;
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    indices
        .map(|i| i as f64 * step)
        .map(|value| Tick { value, label: Some(decimal(value, decimals, step)) })
        .collect()
}

/// A value on a linear axis; thousands of millions are written as powers of ten.
fn decimal(value: f64, decimals: usize, step: f64) -> String {
    if step >= 1e5 { scientific(value) } else { signed(value, decimals) }
}

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
        let labels: Vec<_> =
            linear(-1.93, -0.41, |_| true).into_iter().filter_map(|tick| tick.label).collect();
        assert_eq!(labels, ["−1.8", "−1.6", "−1.4", "−1.2", "−1.0", "−0.8", "−0.6"]);
    }
}
