//! [`CodeMap`]: frequencies and embeddings of a tokenizer's codes (LG-Tok, Figs. 6 and 7).

use burn::tensor::{Device, Tensor, TensorData};

use super::codec::Tokenizer;
use super::halves::host;
use super::patch::leading;
use crate::codes::{CodeHistogram, CodeMap, ScaleCodes, TokenStore};
use crate::data::Split;

impl CodeMap {
    /// Counts the codes of a split and lays out their embeddings.
    pub fn of(tokenizer: &Tokenizer, tokens: &TokenStore, split: Split) -> Self {
        let codebooks = tokenizer.quantizer().codebooks();
        let histogram = |(i, n_vocab): (usize, usize)| {
            let clips = (0..tokens.n_clips(split)).map(move |clip| tokens.scale(split, clip, i));
            CodeHistogram::new(n_vocab, clips.flatten())
        };
        let sizes = tokens.grid().scales.iter().map(|scale| scale.n_vocab).enumerate();
        let histograms: Vec<_> = sizes.map(histogram).collect();
        let rows =
            codebooks.into_iter().zip(&histograms).map(|(book_vc, met)| Codes::of(book_vc, met));
        let scales: Vec<Codes> = rows.collect();
        let (axes, explained) = axes(&scales);
        let placed = scales.into_iter().zip(histograms).map(|(codes, met)| ScaleCodes {
            places: codes.rows.iter().map(|row| axes.place(row)).collect(),
            met,
        });
        Self { scales: placed.collect(), explained }
    }
}

/// The embeddings of a codebook, and which of them were met.
struct Codes {
    rows: Vec<Vec<f64>>,
    met: Vec<bool>,
}

impl Codes {
    fn of(book_vc: Tensor<2>, met: &CodeHistogram) -> Self {
        let c = book_vc.dims()[1];
        let values = host(book_vc);
        let row = |row: &[f32]| row.iter().copied().map(f64::from).collect();
        let met = met.counts().iter().map(|&count| count > 0).collect();
        Self { rows: values.chunks_exact(c).map(row).collect(), met }
    }

    fn that_were_met(&self) -> impl Iterator<Item = &[f64]> {
        let of = self.rows.iter().zip(&self.met).filter(|(_, met)| **met);
        of.map(|(row, _)| row.as_slice())
    }
}

/// Two axes through the mean.
struct Axes {
    mean: Vec<f64>,
    /// `[2][c]`.
    axes: [Vec<f64>; 2],
}

impl Axes {
    fn place(&self, row: &[f64]) -> [f64; 2] {
        let along = |axis: &Vec<f64>| -> f64 {
            row.iter().zip(&self.mean).zip(axis).map(|((x, mean), a)| (x - mean) * a).sum()
        };
        self.axes.each_ref().map(along)
    }
}

/// The principal components of the codes that were met, and the share of variance along each.
fn axes(scales: &[Codes]) -> (Axes, [f64; 2]) {
    let rows: Vec<&[f64]> = scales.iter().flat_map(Codes::that_were_met).collect();
    let c = rows.first().map_or(0, |row| row.len());
    let mean: Vec<f64> =
        (0..c).map(|j| rows.iter().map(|row| row[j]).sum::<f64>() / rows.len() as f64).collect();
    let apart = |row: &[f64], j: usize| row[j] - mean[j];
    let entry = |(i, j)| rows.iter().map(|row| apart(row, i) * apart(row, j)).sum::<f64>();
    let covariance: Vec<f64> =
        (0..c).flat_map(|i| (0..c).map(move |j| (i, j))).map(entry).collect();
    let variance: f64 = (0..c).map(|i| covariance[i * c + i]).sum();
    let k = c.min(2);
    let device = Device::flex();
    let values: Vec<f32> = covariance.iter().map(|&x| x as f32).collect();
    let covariance_cc = Tensor::from_data(TensorData::new(values, [c, c]), &device);
    let found = host(leading(&covariance_cc, k, &device));
    let axis = |j: usize| -> Vec<f64> {
        (0..c).map(|i| if j < k { f64::from(found[i * k + j]) } else { 0.0 }).collect()
    };
    let axes = Axes { mean, axes: [axis(0), axis(1)] };
    let mut along = [0.0; 2];
    for place in rows.iter().map(|row| axes.place(row)) {
        along.iter_mut().zip(place).for_each(|(sum, x)| *sum += x * x);
    }
    (axes, along.map(|sum| if variance > 0.0 { sum / variance } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(rows: &[[f64; 3]], counts: &[u32]) -> Codes {
        let met = counts.iter().map(|&count| count > 0).collect();
        Codes { rows: rows.iter().map(|row| row.to_vec()).collect(), met }
    }

    #[test]
    fn the_axes_are_those_along_which_codes_that_were_met_differ() {
        // Two scales in the plane z = 5, longer along y; one code far off that no clip has.
        let first = codes(&[[1.0, 4.0, 5.0], [-1.0, -4.0, 5.0], [0.0, 0.0, 900.0]], &[3, 1, 0]);
        let second = codes(&[[1.0, -4.0, 5.0], [-1.0, 4.0, 5.0]], &[1, 1]);
        let (axes, explained) = axes(&[first, second]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
        assert!(near(explained[0], 16.0 / 17.0) && near(explained[1], 1.0 / 17.0), "{explained:?}");
        let [along, across] = axes.place(&[1.0, 4.0, 5.0]);
        assert!(near(along.abs(), 4.0) && near(across.abs(), 1.0), "{along} {across}");
        assert!(near(axes.place(&[0.0, 0.0, 900.0])[0], 0.0));
    }

    #[test]
    fn codes_that_are_one_have_a_place() {
        let (axes, explained) = axes(&[codes(&[[2.0, 3.0, 4.0]], &[7])]);
        assert_eq!(explained, [0.0; 2]);
        assert_eq!(axes.place(&[2.0, 3.0, 4.0]), [0.0; 2]);
    }

    #[test]
    fn frequencies_are_beside_that_of_codes_that_are_all_alike() {
        let met = CodeHistogram::new(4, &[0, 0, 0, 2]);
        let codes = ScaleCodes { met, places: vec![[0.0; 2], [1.0; 2], [2.0; 2], [3.0; 2]] };
        let found: Vec<_> = codes.that_were_met().collect();
        assert_eq!(found, [([0.0; 2], 3.0), ([2.0; 2], 1.0)]);
    }
}
