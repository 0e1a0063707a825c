//! The units that the published coefficients of approach 3 belong to.

use super::TokensPerCharacter;
use crate::laws::input::point::IsoFlopPoint;

/// The least FLOPs of a row that Tao et al. fit their loss formula to.
pub const PUBLISHED_MIN_FLOPS: f64 = 2.18e17;

/// A run in the units of the published approach 3: N_nv and N_v in millions, D in billions; the
/// rest stays.
///
/// Their D is not the run's. They turn V into thousands first and then compute D = H f(V) with that
/// V, though their f is of V itself: f(4.096) = .99 stands where f(4096) = .33 is meant. Every D is
/// 2.6 to 3.1 times too large, by a factor that depends on V, so their coefficients A2, α2 and B
/// describe it and not the tokens seen. The slip is kept here to reproduce them, and nowhere else.
/// The run's own characters H = D / f(V) come from its true D and V.
///
/// They then leave out what spent under [`PUBLISHED_MIN_FLOPS`].
pub fn published_units(point: &IsoFlopPoint) -> IsoFlopPoint {
    let f = TokensPerCharacter::TAO;
    let characters = point.tokens / f.at(point.n_vocab);
    let tokens = characters / 1e9 * f.at(point.n_vocab / 1e3);
    IsoFlopPoint { tokens, ..in_millions(point) }
}

/// A run with N_nv and N_v in millions and its own D in billions; the rest stays.
pub fn in_millions(point: &IsoFlopPoint) -> IsoFlopPoint {
    IsoFlopPoint {
        params_nonvocab: point.params_nonvocab / 1e6,
        params_vocab: point.params_vocab / 1e6,
        tokens: point.tokens / 1e9,
        ..point.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::super::runs;
    use super::*;

    #[test]
    fn the_cut_leaves_1054_runs() {
        let Some(runs) = runs::published() else { return };
        assert_eq!(runs.iter().filter(|run| run.flops >= PUBLISHED_MIN_FLOPS).count(), 1054);
    }

    #[test]
    fn the_first_run_has_the_slip_in_its_tokens() {
        let run = runs::run(33222784.0, 4096.0, 512.0, 60e6, -1.35);
        let published = published_units(&run);
        assert!((published.params_nonvocab - 33.222784).abs() < 1e-12);
        assert!((published.params_vocab - 2.097152).abs() < 1e-12);
        // H = 60e6 / f(4096) = .18082054 billion characters; f(4.096) = 0.99447199.
        assert!((published.tokens - 0.17982096390377728).abs() < 1e-14);
        assert_eq!((published.n_vocab, published.flops), (run.n_vocab, run.flops));
    }
}
