//! FSQ's levels: which ones stand for a codebook size, and the mixed-radix numbers they make.

/// ScaMo Table 8: the size a set of levels is named after, and the levels.
///
/// The size that counts as V is always the product: 240 codes where the paper says 2^8.
const TABLE: [(usize, &[usize]); 9] = [
    (16, &[5, 3]),
    (64, &[8, 8]),
    (256, &[8, 6, 5]),
    (512, &[8, 8, 8]),
    (1024, &[8, 5, 5, 5]),
    (2048, &[8, 8, 6, 5]),
    (4096, &[7, 5, 5, 5, 5]),
    (16384, &[8, 8, 8, 6, 5]),
    (65536, &[8, 8, 8, 5, 5, 5]),
];

/// The levels for a codebook size, nominal (256) or real (240); `None` where ScaMo has none.
pub fn levels_for(nominal: usize) -> Option<&'static [usize]> {
    let wanted =
        |&&(name, levels): &&(usize, &[usize])| name == nominal || n_codes(levels) == nominal;
    TABLE.iter().find(wanted).map(|&(_, levels)| levels)
}

/// The nominal sizes of ScaMo Table 8, in ascending order.
pub fn nominal_sizes() -> impl Iterator<Item = usize> {
    TABLE.iter().map(|&(name, _)| name)
}

/// Codes that a set of levels makes: their product.
pub fn n_codes(levels: &[usize]) -> usize {
    levels.iter().product()
}

/// Σ digitᵢ · Π_{j<i} Lⱼ: the first dimension runs fastest. Digits are in 0..Lᵢ.
pub fn index_of_digits(levels: &[usize], digits: impl IntoIterator<Item = usize>) -> u32 {
    let add = |(index, basis), (digit, &level)| (index + digit * basis, basis * level);
    digits.into_iter().zip(levels).fold((0, 1), add).0 as u32
}

/// The digits of an index, the first dimension's first; inverse of [`index_of_digits`].
pub fn digits_of_index(levels: &[usize], index: u32) -> impl Iterator<Item = usize> {
    let split = |rest: &mut usize, &level: &usize| {
        let digit = *rest % level;
        *rest /= level;
        Some(digit)
    };
    levels.iter().scan(index as usize, split)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nominal_and_real_sizes_name_the_same_levels() {
        let real = [15, 64, 240, 512, 1000, 1920, 4375, 15360, 64000];
        for (nominal, real) in nominal_sizes().zip(real) {
            let levels = levels_for(nominal).unwrap();
            assert_eq!(n_codes(levels), real);
            assert_eq!(levels_for(real), Some(levels));
        }
        assert_eq!(levels_for(128), None);
    }

    #[test]
    fn indices_and_digits_are_one_to_one_over_every_code() {
        for levels in nominal_sizes().filter_map(levels_for) {
            let mut seen = vec![false; n_codes(levels)];
            for index in 0..n_codes(levels) as u32 {
                let digits: Vec<_> = digits_of_index(levels, index).collect();
                assert!(digits.iter().zip(levels).all(|(digit, level)| digit < level));
                assert_eq!(index_of_digits(levels, digits), index);
                seen[index as usize] = true;
            }
            assert!(seen.into_iter().all(|met| met));
        }
    }

    #[test]
    fn the_first_dimension_runs_fastest() {
        assert_eq!(digits_of_index(&[8, 6, 5], 9).collect::<Vec<_>>(), [1, 1, 0]);
    }
}
