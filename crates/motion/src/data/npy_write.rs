//! Arrays of numbers into `.npy` files.

use std::path::Path;

use npyz::{WriteOptions, WriterBuilder};

use crate::files::{FileError, atomic};

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
pub fn npy_bytes(shape: &[usize], values: &[f32]) -> Vec<u8> {
    assert_eq!(shape.iter().product::<usize>(), values.len(), "the values fill the shape");
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut bytes = Vec::with_capacity(128 + 4 * values.len());
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
    use crate::data::{NpyArray, parse_npy};

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
