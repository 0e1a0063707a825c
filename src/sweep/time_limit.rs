//! Time limits as Slurm writes them.

/// Minutes of a time limit: `90`, `90:30`, `4:00:00`, `2-12`, `2-12:00`, `2-12:00:00`; `None` where
/// it is none, or has no end.
pub fn minutes(text: &str) -> Option<f64> {
    let (days, rest) = match text.trim().split_once('-') {
        Some((days, rest)) => (Some(number(days)?), rest),
        None => (None, text.trim()),
    };
    let parts: Vec<f64> = rest.split(':').map(number).collect::<Option<_>>()?;
    let (hours, minutes, seconds) = match (days, parts[..].as_ref()) {
        (None, [minutes]) => (0.0, *minutes, 0.0),
        (None, [minutes, seconds]) => (0.0, *minutes, *seconds),
        (Some(_), [hours]) => (*hours, 0.0, 0.0),
        (Some(_), [hours, minutes]) => (*hours, *minutes, 0.0),
        (_, [hours, minutes, seconds]) => (*hours, *minutes, *seconds),
        _ => return None,
    };
    let minutes = (days.unwrap_or(0.0) * 24.0 + hours) * 60.0 + minutes + seconds / 60.0;
    (minutes > 0.0).then_some(minutes)
}

fn number(text: &str) -> Option<f64> {
    let digits = !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    digits.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::minutes;

    #[test]
    fn every_form_that_slurm_takes_is_read_and_no_other() {
        let good = [
            ("90", 90.0),
            ("1:30", 1.5),
            ("4:00:00", 240.0),
            ("1-02", 1560.0),
            ("1-02:03", 1563.0),
            ("1-02:03:30", 1563.5),
        ];
        for (text, expected) in good {
            assert_eq!(minutes(text), Some(expected), "{text}");
        }
        for text in ["", "0", "4h", "1:2:3:4", "-1", "UNLIMITED", "1-", "1e2"] {
            assert_eq!(minutes(text), None, "{text}");
        }
    }
}
