//! Streams of a PDF as zlib packs them.

use miniz_oxide::deflate::compress_to_vec_zlib;

/// How hard streams are packed: zlib's own default.
const EFFORT: u8 = 6;

/// The bytes of a stream with the filter `FlateDecode`.
pub fn packed(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec_zlib(bytes, EFFORT)
}
