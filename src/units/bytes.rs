//! Amounts of memory.

/// Bytes from `8GB`, `512MiB`, `2e9`: decimal and binary units.
///
/// # Errors
/// A sentence that says what is understood.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let trimmed = text.trim();
    let unit = trimmed.trim_start_matches(|c: char| c.is_ascii_digit() || "._+-".contains(c));
    // `2e9` is a number, `2EB` is not asked for.
    let (number, unit) = match trimmed.parse::<f64>() {
        Ok(_) => (trimmed, ""),
        Err(_) => (&trimmed[..trimmed.len() - unit.len()], unit.trim()),
    };
    let factor = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "t" | "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024f64.powi(2),
        "gib" => 1024f64.powi(3),
        "tib" => 1024f64.powi(4),
        _ => return Err(format!("`{unit}` is no unit of memory: MB, GB, MiB, GiB")),
    };
    match number.parse::<f64>() {
        Ok(n) if n > 0.0 && n.is_finite() => Ok((n * factor) as u64),
        _ => Err(format!("{text} is no amount of memory, as 8GB")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_with_their_units() {
        let read = |text: &str| parse_bytes(text).unwrap();
        assert_eq!(read("8GB"), 8_000_000_000);
        assert_eq!(read("2e9"), 2_000_000_000);
        assert_eq!(read("1.5 GiB"), 3 << 29);
        assert_eq!(read("512m"), 512_000_000);
        for wrong in ["", "GB", "-1GB", "8 elephants", "inf", "NaN"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
