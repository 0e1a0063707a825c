//! Formats numbers for a person.

/// `x` in scientific notation with at most `digits` after the point, trailing zeros left out.
pub fn short(x: f64, digits: usize) -> String {
    let text = format!("{x:.digits$e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) if mantissa.contains('.') => {
            let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
            format!("{mantissa}e{exponent}")
        }
        _ => text,
    }
}

/// A budget or another count in at most four significant digits: `3e10`, `1.215e18`.
pub fn count(x: f64) -> String {
    short(x, 3)
}

/// A factor in two digits, or three below 2: `1.04`, `1.6`, `9.4`, `94`, `310`.
pub fn times(factor: f64) -> String {
    let digits = if factor < 2.0 { 2 } else { 1 };
    let rounded: f64 = format!("{factor:.digits$e}").parse().expect("a number was written");
    rounded.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lose_trailing_zeros_only() {
        assert_eq!(count(1e10), "1e10");
        assert_eq!(count(1.2154e18), "1.215e18");
        assert_eq!(short(200.0, 2), "2e2");
        assert_eq!(short(1.9999e3, 2), "2e3");
    }

    #[test]
    fn factors_have_two_digits_and_three_below_two() {
        let factors = [1.04, 1.6, 9.375, 93.75, 312.5, 10.0].map(times);
        assert_eq!(factors, ["1.04", "1.6", "9.4", "94", "310", "10"]);
    }
}
