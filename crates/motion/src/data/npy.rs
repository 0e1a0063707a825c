//! Arrays of numbers from `.npy` files, checked before anything is made of them, and into such files.

use std::path::Path;

use npyz::{AutoSerialize, NpyHeader, Order, WriteOptions, WriterBuilder};

use crate::files::{FileError, atomic};

/// A finite array in C order.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyArray {
    /// Sizes of the axes, slowest first.
    pub shape: Vec<usize>,
    /// The product of `shape` values.
    pub values: Vec<f32>,
}

/// Why bytes are not an array that can be used; reads on after the file's name and a colon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NpyProblem {
    /// The file does not begin as `.npy` files of versions 1 to 3 do.
    #[error("no npy file: {0}")]
    Header(String),
    /// The numbers are of another kind.
    #[error("holds numbers of type {0}; save it as '<f4' or '<f8'")]
    Kind(String),
    /// The first axis varies fastest.
    #[error("is in Fortran order; save numpy.ascontiguousarray of it")]
    FortranOrder,
    /// The file is cut short or too long.
    #[error("is cut short or too long: {found} bytes of numbers do not fill the shape {shape:?}")]
    Length { shape: Vec<u64>, found: usize },
    /// A number is NaN, infinite, or beyond single precision.
    #[error("holds a number that is not finite, the first at {position:?}")]
    NotFinite { position: Vec<usize> },
    /// The axes are not those asked for.
    #[error("has shape {found:?} where {expected} is needed")]
    Shape { found: Vec<usize>, expected: &'static str },
}

/// The array in `bytes`, the whole content of a `.npy` file of type `<f4` or `<f8`.
///
/// # Errors
/// [`NpyProblem`] for another type, Fortran order, a length that does not fit the shape, and
/// numbers that are not finite in single precision.
pub fn parse_npy(bytes: &[u8]) -> Result<NpyArray, NpyProblem> {
    let length = header_bytes(bytes);
    if length > LONGEST_HEADER {
        return Err(NpyProblem::Header("its header is too long".to_string()));
    }
    let opened = bytes.iter().take(12 + length).filter(|byte| b"([{".contains(byte));
    if opened.count() > MOST_BRACKETS {
        return Err(NpyProblem::Header("its header has too many brackets".to_string()));
    }
    let mut data = bytes;
    let header =
        NpyHeader::from_reader(&mut data).map_err(|error| NpyProblem::Header(error.to_string()))?;
    if header.order() != Order::C {
        return Err(NpyProblem::FortranOrder);
    }
    let values = match header.dtype().descr().as_str() {
        "'<f4'" => numbers(data, header.shape(), f32::from_le_bytes)?,
        "'<f8'" => numbers(data, header.shape(), |eight| f64::from_le_bytes(eight) as f32)?,
        other => return Err(NpyProblem::Kind(other.to_owned())),
    };
    // Lengths agree, so no axis of a non-empty array is too large; an empty array is refused by the check of its
    // shape.
    let shape: Vec<usize> =
        header.shape().iter().map(|&n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(NpyProblem::NotFinite { position: position(index, &shape) }),
        None => Ok(NpyArray { shape, values }),
    }
}

/// Bytes of a header: a type and a shape. What reads it takes memory for as many as a file claims.
const LONGEST_HEADER: usize = 1024;
/// Opening brackets of a header, of which a plain array has two. What reads it takes twice the time for each one that
/// nothing closes.
const MOST_BRACKETS: usize = 8;

/// The length of the header, which stands behind eight bytes, in two or, from version 2 on, four.
fn header_bytes(bytes: &[u8]) -> usize {
    match bytes.strip_prefix(b"\x93NUMPY").unwrap_or_default() {
        [1, _, a, b, ..] => u16::from_le_bytes([*a, *b]).into(),
        [_, _, a, b, c, d, ..] => u32::from_le_bytes([*a, *b, *c, *d]) as usize,
        _ => 0,
    }
}

/// Numbers of `N` bytes each, as many as `shape` says and no more.
fn numbers<const N: usize>(
    data: &[u8],
    shape: &[u64],
    number: impl Fn([u8; N]) -> f32,
) -> Result<Vec<f32>, NpyProblem> {
    let expected = shape.iter().try_fold(N as u64, |product, &n| product.checked_mul(n));
    if expected != Some(data.len() as u64) {
        return Err(NpyProblem::Length { shape: shape.to_vec(), found: data.len() });
    }
    let (chunks, _) = data.as_chunks::<N>();
    Ok(chunks.iter().map(|&chunk| number(chunk)).collect())
}

/// Coordinates of the flat `index` in an array of `shape`.
fn position(mut index: usize, shape: &[usize]) -> Vec<usize> {
    let mut position = vec![0; shape.len()];
    for (at, &n) in position.iter_mut().zip(shape).rev() {
        (*at, index) = (index % n, index / n);
    }
    position
}

// Writing.

/// Writes `values` as a `.npy` file of type `<f4` in C order, whole, by rename.
///
/// # Errors
/// [`FileError::Write`].
///
/// # Panics
/// If `shape` has another number of elements than `values`.
pub fn write_npy(path: &Path, shape: &[usize], values: &[f32]) -> Result<(), FileError> {
    atomic::write_bytes(path, &npy_bytes(shape, values))
}

/// The bytes of such a file.
///
/// # Panics
/// If `shape` has another number of elements than `values`.
pub fn npy_bytes<T: AutoSerialize>(shape: &[usize], values: &[T]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), values.len(), "the values fill the shape");
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut bytes = Vec::with_capacity(128 + size_of_val(values));
    let options = WriteOptions::new().default_dtype().shape(&shape);
    let filled = options.writer(&mut bytes).begin_nd().and_then(|mut writer| {
        values.iter().try_for_each(|value| writer.push(value))?;
        writer.finish()
    });
    filled.expect("a vector takes every byte");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_and_double_precision_read_alike() {
        let values = [1.5, -2.0, 0.25, 4.0, 5.0, 6.5];
        let expected = NpyArray { shape: vec![2, 3], values: values.to_vec() };
        assert_eq!(parse_npy(&npy_bytes(&[2, 3], &values)), Ok(expected.clone()));
        let double: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        assert_eq!(parse_npy(&npy_bytes(&[2, 3], &double)), Ok(expected));
    }

    #[test]
    fn other_types_are_named() {
        let problem = parse_npy(&npy_bytes(&[2], &[1i32, 2])).unwrap_err();
        assert_eq!(problem, NpyProblem::Kind("'<i4'".to_owned()));
    }

    #[test]
    fn files_that_are_cut_short_or_no_arrays_are_refused() {
        let bytes = npy_bytes(&[2, 2], &[1.0f32; 4]);
        let found = |bytes: &[u8]| parse_npy(bytes).unwrap_err();
        assert!(matches!(found(&bytes[..bytes.len() - 4]), NpyProblem::Length { found: 12, .. }));
        assert!(matches!(found(&bytes[..20]), NpyProblem::Header(_)));
        assert!(matches!(found(b"clip,frames\n1,2\n"), NpyProblem::Header(_)));
        assert!(matches!(found(b""), NpyProblem::Header(_)));
    }

    #[test]
    fn numbers_that_are_not_finite_are_found_by_row_and_column() {
        let at = |values: [f64; 4]| parse_npy(&npy_bytes(&[2, 2], &values)).unwrap_err();
        let second_row = NpyProblem::NotFinite { position: vec![1, 0] };
        assert_eq!(at([0.0, 0.0, f64::NAN, f64::INFINITY]), second_row);
        // Finite in double precision, infinite in single.
        assert_eq!(at([0.0, 0.0, 1e300, 0.0]), second_row);
    }

    #[test]
    fn fortran_order_is_refused() {
        let mut bytes = npy_bytes(&[2, 2], &[1.0f32; 4]);
        let at = bytes.windows(5).position(|w| w == b"False").expect("the order is in the header");
        bytes[at..at + 5].copy_from_slice(b"True ");
        assert_eq!(parse_npy(&bytes), Err(NpyProblem::FortranOrder));
    }

    #[test]
    fn arrays_of_any_shape_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<f32> = (0..24).map(|i| i as f32 / 7.0).collect();
        for shape in [vec![24], vec![4, 6], vec![2, 3, 4], vec![0, 263]] {
            let path = folder.path().join("motions/0.npy");
            let values = values[..shape.iter().product()].to_vec();
            write_npy(&path, &shape, &values).unwrap();
            let read = parse_npy(&std::fs::read(&path).unwrap());
            assert_eq!(read, Ok(NpyArray { shape, values }));
        }
        assert_eq!(std::fs::read_dir(folder.path().join("motions")).unwrap().count(), 1);
    }
}
