//! What kind of failure an error is.

use std::io;

use anyhow::Error;

use crate::data::DataError;
use crate::record::{Failure, FailureKind};
use crate::tokenizer::TokenizerError;
use crate::train::TrainError;

/// The failure that ends a job with this error.
pub fn failure_of(error: &Error) -> Failure {
    let sentence = format!("{error:#}");
    let kind = error.chain().find_map(|cause| {
        let train = cause.downcast_ref::<TrainError>().and_then(of_train);
        let tokenizer = || cause.downcast_ref::<TokenizerError>().and_then(of_tokenizer);
        let data = || cause.downcast_ref::<DataError>().map(|_| FailureKind::BadData);
        train.or_else(tokenizer).or_else(data)
    });
    let otherwise =
        if sentence.contains("is damaged") { FailureKind::Damaged } else { FailureKind::Other };
    Failure::of_sentence(sentence, kind.unwrap_or(otherwise))
}

/// The failure of a write.
pub fn of_io(error: &io::Error) -> Failure {
    Failure::of_sentence(error.to_string(), FailureKind::Other)
}

fn of_train(error: &TrainError) -> Option<FailureKind> {
    match error {
        TrainError::NonFinite { .. } | TrainError::Diverged { .. } => Some(FailureKind::Diverged),
        TrainError::Vocabulary { .. } | TrainError::Context { .. } => Some(FailureKind::BadData),
        TrainError::Weights(_) => Some(FailureKind::Damaged),
        TrainError::Stopped { .. } | TrainError::Precision(_) => None,
    }
}

fn of_tokenizer(error: &TokenizerError) -> Option<FailureKind> {
    match error {
        TokenizerError::NonFinite { .. } => Some(FailureKind::Diverged),
        TokenizerError::Spec { .. }
        | TokenizerError::NoWindow { .. }
        | TokenizerError::ShortClip { .. }
        | TokenizerError::UnknownCode { .. }
        | TokenizerError::Data(_) => Some(FailureKind::BadData),
        TokenizerError::Weights(_) | TokenizerError::File { .. } => Some(FailureKind::Damaged),
        TokenizerError::Write(_) => Some(FailureKind::Other),
        TokenizerError::Stopped { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_known_through_what_wraps_it() {
        let diverged = TrainError::NonFinite { step: 3, steps: 9, loss: f64::NAN };
        let error = Error::new(diverged).context("training");
        assert_eq!(failure_of(&error).kind, FailureKind::Diverged);
        let full = io::Error::from_raw_os_error(28);
        let error = Error::new(TokenizerError::Write(full)).context("writing codes");
        let failure = failure_of(&error);
        assert_eq!(failure.kind, FailureKind::DiskFull);
        assert!(failure.reason.contains("writing codes: No space left"), "{failure:?}");
        assert_eq!(failure_of(&Error::msg("what is this")).kind, FailureKind::Other);
    }
}
