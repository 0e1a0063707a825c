//! Linear least squares by Householder reflections.

/// Relative size below which a pivot counts as zero.
const RANK_TOLERANCE: f64 = 1e-10;

/// The least-squares solution of X c ≈ y.
#[derive(Clone, Debug)]
pub(super) struct LeastSquares {
    pub coefficients: Vec<f64>,
    /// Residual sum of squares.
    pub rss: f64,
    /// Rows minus coefficients.
    pub dof: usize,
    /// R of X = QR, row by row; its lower triangle is not read.
    r: Vec<Vec<f64>>,
}

/// Solves X c ≈ y for the rows of X; none where the rows do not determine every coefficient.
///
/// Householder's QR works on X itself, so the error grows with the condition of X and not, as for
/// the normal equations, with its square.
pub(super) fn least_squares(rows: &[Vec<f64>], y: &[f64]) -> Option<LeastSquares> {
    assert_eq!(rows.len(), y.len(), "one value for each row");
    let p = rows.first()?.len();
    if rows.len() < p {
        return None;
    }
    // y rides along as a last column, and comes out as Qᵀy.
    let mut a: Vec<Vec<f64>> =
        rows.iter().zip(y).map(|(row, y)| row.iter().copied().chain([*y]).collect()).collect();
    for j in 0..p {
        reflect(&mut a, j)?;
    }
    let coefficients = back_substitute(&a, p);
    let rss = a[p..].iter().map(|row| row[p].powi(2)).sum();
    let dof = rows.len() - p;
    a.truncate(p);
    Some(LeastSquares { coefficients, rss, dof, r: a })
}

/// Clears column `j` below the diagonal; none where the column depends on those before it.
fn reflect(a: &mut [Vec<f64>], j: usize) -> Option<()> {
    let whole = a.iter().map(|row| row[j].powi(2)).sum::<f64>().sqrt();
    let norm = a[j..].iter().map(|row| row[j].powi(2)).sum::<f64>().sqrt();
    if norm <= RANK_TOLERANCE * whole || !norm.is_finite() {
        return None;
    }
    let alpha = -norm.copysign(a[j][j]);
    let mut v: Vec<f64> = a[j..].iter().map(|row| row[j]).collect();
    v[0] -= alpha;
    let vv: f64 = v.iter().map(|v| v * v).sum();
    for k in j..a[j].len() {
        let dot: f64 = v.iter().zip(&a[j..]).map(|(v, row)| v * row[k]).sum();
        v.iter().zip(&mut a[j..]).for_each(|(v, row)| row[k] -= 2.0 * dot / vv * v);
    }
    Some(())
}

fn back_substitute(a: &[Vec<f64>], p: usize) -> Vec<f64> {
    let mut c = vec![0.0; p];
    for j in (0..p).rev() {
        let known: f64 = (j + 1..p).map(|k| a[j][k] * c[k]).sum();
        c[j] = (a[j][p] - known) / a[j][j];
    }
    c
}

impl LeastSquares {
    /// Standard error of gᵀc for noise of unit standard deviation: ‖R⁻ᵀg‖.
    pub fn unit_error(&self, g: &[f64]) -> f64 {
        let mut w: Vec<f64> = Vec::with_capacity(g.len());
        for (j, g) in g.iter().enumerate() {
            let known: f64 = (0..j).map(|k| self.r[k][j] * w[k]).sum();
            w.push((g - known) / self.r[j][j]);
        }
        w.iter().map(|w| w * w).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worked_regression_is_reproduced() {
        // x 1..=4, y 6, 5, 7, 10: y = 3.5 + 1.4 x, RSS 4.2, (XᵀX)⁻¹ of the slope 1/5.
        let rows: Vec<_> = (1..=4).map(|x| vec![1.0, f64::from(x)]).collect();
        let fit = least_squares(&rows, &[6.0, 5.0, 7.0, 10.0]).unwrap();
        assert!((fit.coefficients[0] - 3.5).abs() < 1e-13);
        assert!((fit.coefficients[1] - 1.4).abs() < 1e-13);
        assert!((fit.rss - 4.2).abs() < 1e-12);
        assert_eq!(fit.dof, 2);
        assert!((fit.unit_error(&[0.0, 1.0]) - 0.2f64.sqrt()).abs() < 1e-13);
    }

    #[test]
    fn dependent_columns_have_no_solution() {
        let rows: Vec<_> = (1..=5).map(|x| vec![f64::from(x), 2.0 * f64::from(x)]).collect();
        assert!(least_squares(&rows, &[1.0; 5]).is_none());
        assert!(least_squares(&[vec![1.0, 2.0]], &[1.0]).is_none());
        assert!(least_squares(&[], &[]).is_none());
    }
}
