//! Small data sets on disk for the tests of this module.

use std::fs;
use std::path::Path;

use npyz::{AutoSerialize, WriterBuilder};
use tempfile::TempDir;

use crate::motion::N_FEATURES;

/// The content of a `.npy` file with `values` in `shape`.
pub(super) fn npy_bytes<T: AutoSerialize>(shape: &[u64], values: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().shape(shape);
    let mut writer = options.writer(&mut bytes).begin_nd().expect("a vector takes every byte");
    values.iter().for_each(|value| writer.push(value).expect("a vector takes every byte"));
    writer.finish().expect("as many values as the shape says");
    bytes
}

/// Rows that differ in every column and from clip to clip; `[n_frames, 263]`.
pub(super) fn rows(n_frames: usize, seed: usize) -> Vec<f32> {
    (0..n_frames * N_FEATURES).map(|i| ((i * 31 + seed * 7919) % 1009) as f32 / 1009.0).collect()
}

/// A folder in the HumanML3D layout that lasts as long as the value.
pub(super) struct DataSet(TempDir);

impl DataSet {
    /// Three sound training clips and one each to validate and test, 60 frames and one caption.
    pub(super) fn sound() -> DataSet {
        let set = DataSet(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(set.path().join("new_joint_vecs")).expect("a writable folder");
        fs::create_dir(set.path().join("texts")).expect("a writable folder");
        for seed in 0..5 {
            set.clip(
                &format!("00000{seed}"),
                60,
                seed,
                "he turns left#he/PRON turn/VERB#0.0#0.0\n",
            );
        }
        set.write("train.txt", "000000\n000001\n000002\n");
        set.write("val.txt", "000003\n");
        set.write("test.txt", "000004\n");
        set
    }

    pub(super) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(super) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path().join(name), content).expect("a writable folder");
    }

    pub(super) fn remove(&self, name: &str) {
        fs::remove_file(self.path().join(name)).expect("the file is there");
    }

    /// Writes the two files of a clip.
    pub(super) fn clip(&self, id: &str, n_frames: usize, seed: usize, text: &str) {
        let bytes = npy_bytes(&[n_frames as u64, N_FEATURES as u64], &rows(n_frames, seed));
        self.write(&format!("new_joint_vecs/{id}.npy"), bytes);
        self.write(&format!("texts/{id}.txt"), text);
    }
}
