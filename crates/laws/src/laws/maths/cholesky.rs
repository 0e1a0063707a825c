//! Systems of a handful of equations, on the stack.

/// The first `n` entries of the solution of (M + `damping` I) s = b by Cholesky, from the lower half of M;
/// none where that matrix is not positive definite.
pub(in crate::laws) fn solve<const N: usize>(
    m: &[[f64; N]; N],
    damping: f64,
    b: &[f64; N],
    n: usize,
) -> Option<[f64; N]> {
    let factor = cholesky(m, damping, n)?;
    let mut s = *b;
    for i in 0..n {
        let known: f64 = (0..i).map(|j| factor[i][j] * s[j]).sum();
        s[i] = (s[i] - known) / factor[i][i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| factor[j][i] * s[j]).sum();
        s[i] = (s[i] - known) / factor[i][i];
    }
    Some(s)
}

fn cholesky<const N: usize>(m: &[[f64; N]; N], damping: f64, n: usize) -> Option<[[f64; N]; N]> {
    let mut factor = [[0.0; N]; N];
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest = m[i][j] + if i == j { damping } else { 0.0 } - known;
            if i == j {
                let floor = 1e-14 * (m[i][i].abs() + damping);
                if rest.is_nan() || rest <= floor {
                    return None;
                }
                factor[i][i] = rest.sqrt();
            } else {
                factor[i][j] = rest / factor[j][j];
            }
        }
    }
    Some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solution_solves_and_an_indefinite_matrix_is_refused() {
        let mut m = [[0.0; 3]; 3];
        (m[0][0], m[0][1], m[1][0], m[1][1]) = (4.0, 1.0, 1.0, 3.0);
        let mut b = [0.0; 3];
        (b[0], b[1]) = (1.0, 2.0);
        let s = solve(&m, 0.0, &b, 2).unwrap();
        let back = [0, 1].map(|i| m[i][0] * s[0] + m[i][1] * s[1]);
        assert!((back[0] - 1.0).abs() < 1e-15 && (back[1] - 2.0).abs() < 1e-15);
        m[1][1] = -3.0;
        assert_eq!(solve(&m, 0.0, &b, 2), None);
        assert!(solve(&m, 5.0, &b, 2).is_some());
    }
}
