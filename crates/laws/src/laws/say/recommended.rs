//! Why a law is recommended.

use crate::laws::ranking::recommended::Score;

/// By the scores, the best first, of `budgets` budgets.
pub(in crate::laws) fn why(scores: &[Score], budgets: usize) -> String {
    match scores {
        [] => format!("no law could be tested ({budgets} budgets)"),
        [_] => "no other law could be tested".to_string(),
        [best, .., worst] => format!(
            "fitted to smaller budgets, it missed the losses of larger ones by {:.4} nats (root mean \
             square of {}), {} by {:.4}",
            best.rms,
            best.compared().count(),
            worst.law.about(),
            worst.rms
        ),
    }
}
