//! [`TextJob`]: the captions of a data set, to be embedded once.

use serde::{Deserialize, Serialize};

use crate::spec::{TextSpec, content_id};

/// What the text encoder is asked for, and on which captions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextJob {
    /// Without the path: a file that is moved is the same.
    pub spec: TextSpec,
    pub data_digest: String,
    /// Content of the file that the vectors come from, where they come from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub embeddings: Option<String>,
}

impl TextJob {
    /// The job of a sweep's `text` section on data, and on a file's content, of these digests.
    pub fn new(spec: &TextSpec, data_digest: &str, embeddings: Option<String>) -> Self {
        let spec = TextSpec { path: None, ..spec.clone() };
        Self { spec, data_digest: data_digest.to_string(), embeddings }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}
