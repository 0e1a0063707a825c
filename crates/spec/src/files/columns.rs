//! Columns of numbers in a safetensors file that many processes map and share.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write};
use std::marker::PhantomData;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
use safetensors::tensor::{Dtype, Metadata, SafeTensors, TensorInfo, TensorView, serialize};

use super::FileError;
use super::atomic::write_whole;

/// A number that a column can hold.
pub trait Number: Pod {
    const DTYPE: Dtype;
}

impl Number for u32 {
    const DTYPE: Dtype = Dtype::U32;
}

impl Number for u64 {
    const DTYPE: Dtype = Dtype::U64;
}

impl Number for f32 {
    const DTYPE: Dtype = Dtype::F32;
}

/// A column to be written.
pub struct NewColumn<'a> {
    name: String,
    dtype: Dtype,
    len: usize,
    bytes: &'a [u8],
}

impl<'a> NewColumn<'a> {
    /// A column of these values.
    pub fn new<T: Number>(name: impl Into<String>, values: &'a [T]) -> Self {
        let bytes = bytemuck::cast_slice(values);
        Self { name: name.into(), dtype: T::DTYPE, len: values.len(), bytes }
    }
}

/// The column that holds the digest of all others.
const DIGEST: &str = "digest";

/// The digest of the names and bytes of columns, in the order of names.
fn digest<'a>(columns: impl Iterator<Item = (&'a str, &'a [u8])>) -> [u8; 32] {
    let mut columns: Vec<(&str, &[u8])> = columns.filter(|(name, _)| *name != DIGEST).collect();
    columns.sort_unstable_by_key(|(name, _)| *name);
    let mut hasher = blake3::Hasher::new();
    for (name, bytes) in columns {
        hasher.update(name.as_bytes()).update(&(bytes.len() as u64).to_le_bytes()).update(bytes);
    }
    hasher.finalize().into()
}

/// Writes columns, their digest and text entries as one file, whole, by rename.
pub fn write(
    path: &Path,
    columns: &[NewColumn],
    notes: HashMap<String, String>,
) -> Result<(), FileError> {
    let digest = digest(columns.iter().map(|column| (column.name.as_str(), column.bytes)));
    let digest = NewColumn { name: DIGEST.into(), dtype: Dtype::U32, len: 8, bytes: &digest };
    let views = columns.iter().chain([&digest]).map(|column| {
        let view = TensorView::new(column.dtype, vec![column.len], column.bytes);
        (column.name.clone(), view.expect("shape and length agree"))
    });
    let bytes = serialize(views, Some(notes))
        .map_err(|error| FileError::write(path)(io::Error::other(error)))?;
    write_whole(path, |file| file.write_all(&bytes))
}

/// A file of columns, mapped into memory.
#[derive(Debug)]
pub struct MappedFile {
    path: PathBuf,
    map: Arc<Mmap>,
    metadata: Metadata,
    /// The offset of the columns' bytes.
    start: usize,
}

impl MappedFile {
    /// Maps a file.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(FileError::read(path))?;
        // SAFETY: files of columns are put in place by rename and never written again, so the
        // mapped bytes do not change while they are read.
        let map = unsafe { Mmap::map(&file) }.map_err(FileError::read(path))?;
        let (header, metadata) =
            SafeTensors::read_metadata(&map).map_err(|error| FileError::damaged(path, error))?;
        let start = size_of::<u64>() + header;
        Ok(Self { path: path.to_path_buf(), map: Arc::new(map), metadata, start })
    }

    /// Checks that the columns match the digest; a file without a digest is not ours.
    ///
    /// # Errors
    /// [`FileError::Damaged`].
    pub fn verified(self) -> Result<Self, FileError> {
        let tensors = self.metadata.tensors();
        let bytes = |info: &TensorInfo| {
            let (from, to) = info.data_offsets;
            &self.map[self.start + from..self.start + to]
        };
        let found = || digest(tensors.iter().map(|(name, info)| (name.as_str(), bytes(info))));
        if tensors.get(DIGEST).is_none_or(|told| bytes(told) == found()) {
            drop(tensors);
            return Ok(self);
        }
        Err(self.damaged("its bytes are not those that were written"))
    }

    /// All bytes of the file.
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// A text entry.
    pub fn note(&self, name: &str) -> Option<&str> {
        self.metadata.metadata().as_ref()?.get(name).map(String::as_str)
    }

    /// A text entry as a number.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing or no number.
    pub fn number(&self, name: &str) -> Result<usize, FileError> {
        let number = self.note(name).and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.damaged(format!("its note `{name}` is missing")))
    }

    /// Whether the file has a column of this name.
    pub fn has(&self, name: &str) -> bool {
        self.metadata.info(name).is_some()
    }

    /// A column of the file.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing or of another type.
    pub fn column<T: Number>(&self, name: &str) -> Result<Column<T>, FileError> {
        let info = self.metadata.info(name).filter(|info| info.dtype == T::DTYPE);
        let info = info.ok_or_else(|| self.lacks(name))?;
        let (from, to) = info.data_offsets;
        Ok(Column::new(&self.map, self.start + from..self.start + to))
    }

    /// The shape of a column: one number for a list, two for a matrix.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing.
    pub fn shape(&self, name: &str) -> Result<&[usize], FileError> {
        self.metadata.info(name).map(|info| &info.shape[..]).ok_or_else(|| self.lacks(name))
    }

    fn lacks(&self, name: &str) -> FileError {
        self.damaged(format!("its column `{name}` is missing"))
    }

    /// The error of a damaged file.
    pub fn damaged(&self, reason: impl ToString) -> FileError {
        FileError::damaged(&self.path, reason)
    }
}

/// Numbers in a mapped file, or a copy if they are not aligned.
#[derive(Debug)]
pub enum Column<T> {
    Mapped { map: Arc<Mmap>, bytes: Range<usize>, numbers: PhantomData<T> },
    Copied(Vec<T>),
}

impl<T: Pod> Column<T> {
    fn new(map: &Arc<Mmap>, bytes: Range<usize>) -> Self {
        match bytemuck::try_cast_slice::<u8, T>(&map[bytes.clone()]) {
            Ok(_) => Column::Mapped { map: map.clone(), bytes, numbers: PhantomData },
            Err(_) => Column::Copied(bytemuck::pod_collect_to_vec(&map[bytes])),
        }
    }

    /// The numbers.
    pub fn values(&self) -> &[T] {
        match self {
            Column::Mapped { map, bytes, .. } => bytemuck::cast_slice(&map[bytes.clone()]),
            Column::Copied(values) => values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_that_turned_over_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("codes.safetensors");
        let columns = [NewColumn::new("b", &[1u32, 2, 3]), NewColumn::new("a", &[0.5f32])];
        write(&path, &columns, HashMap::new()).unwrap();
        let file = MappedFile::open(&path).unwrap().verified().unwrap();
        assert_eq!(file.column::<u32>("b").unwrap().values(), [1, 2, 3]);
        let mut bytes = std::fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 4;
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let error = MappedFile::open(&path).unwrap().verified().unwrap_err().to_string();
        assert!(error.contains("not those that were written"), "{error}");
    }

    #[test]
    fn numbers_out_of_line_are_copied() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bytes");
        std::fs::write(&path, [9, 1, 0, 0, 0, 2, 0, 0, 0]).unwrap();
        // SAFETY: nobody writes to the file of this test.
        let map = Arc::new(unsafe { Mmap::map(&File::open(&path).unwrap()) }.unwrap());
        let column = Column::<u32>::new(&map, 1..9);
        assert!(matches!(column, Column::Copied(_)));
        assert_eq!(column.values(), [1, 2]);
    }
}
