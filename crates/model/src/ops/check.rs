//! Whether a device multiplies: drivers are met that load every kernel and give zeros.

use burn::tensor::{Device, Tensor, TensorData};

/// What a device gave that cannot multiply.
#[derive(Debug, thiserror::Error)]
#[error(
    "the device multiplies matrices wrongly ({found} where {right} is right): its driver cannot be \
     used; take another device"
)]
pub struct WrongProduct {
    found: f32,
    right: f32,
}

const ROWS: usize = 33;
const INNER: usize = 17;
const COLUMNS: usize = 29;

/// Small whole numbers, of which products and sums are exact in every order.
fn number(i: usize) -> f32 {
    (i * 7 % 11) as f32 - 5.0
}

/// Multiplies two matrices and looks at every element.
///
/// # Errors
/// The first element that is wrong.
pub fn check_products(device: &Device) -> Result<(), WrongProduct> {
    let matrix = |[rows, columns]: [usize; 2]| {
        let values: Vec<f32> = (0..rows * columns).map(number).collect();
        Tensor::<2>::from_data(TensorData::new(values, [rows, columns]), device)
    };
    let found = matrix([ROWS, INNER]).matmul(matrix([INNER, COLUMNS])).into_data();
    first_wrong(found.iter::<f32>()).map_or(Ok(()), Err)
}

fn first_wrong(found: impl Iterator<Item = f32>) -> Option<WrongProduct> {
    let right = (0..ROWS * COLUMNS).map(|i| {
        let (row, column) = (i / COLUMNS, i % COLUMNS);
        let term = |k| number(row * INNER + k) * number(k * COLUMNS + column);
        (0..INNER).map(term).sum::<f32>()
    });
    let wrong = found.zip(right).find(|(found, right)| found != right);
    wrong.map(|(found, right)| WrongProduct { found, right })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_that_multiply_pass_and_zeros_do_not() {
        check_products(&Device::flex()).unwrap();
        #[expect(deprecated, reason = "the only other device that every build has")]
        check_products(&Device::ndarray()).unwrap();
        let error = first_wrong(std::iter::repeat_n(0.0, ROWS * COLUMNS)).unwrap();
        assert!(error.to_string().contains("(0 where"), "{error}");
        let gone = first_wrong(std::iter::repeat_n(f32::NAN, ROWS * COLUMNS));
        assert!(gone.is_some());
    }
}
