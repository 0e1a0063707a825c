//! Reconstruction and codebook use of the tokenizers against V (ScaMo Fig. 6).

use std::collections::BTreeMap;

use super::cells::sorted;
use super::colour::MUTED;
use super::{
    Axis, Drawing, Legend, Look, Page, Plot, Point, Sample, Scale, Sources, Stroke, bound_stroke,
    category_looks,
};
use crate::tokenizer::TokenizerMetrics;

/// One panel: its title, the name of its axis, its values.
struct Metric {
    title: &'static str,
    label: &'static str,
    scale: Scale,
    of: fn(&TokenizerMetrics) -> f64,
    /// The same of k-means with as many codes, where it was measured.
    of_k_means: fn(&TokenizerMetrics) -> Option<f64>,
}

const METRICS: [Metric; 4] = [
    Metric {
        title: "Reconstruction",
        label: "L1 of normalised features",
        scale: Scale::Linear,
        of: |metrics| metrics.reconstruction_l1,
        of_k_means: |_| None,
    },
    Metric {
        title: "Joint positions",
        label: "MPJPE (mm)",
        scale: Scale::Linear,
        of: |metrics| metrics.mpjpe_mm,
        of_k_means: |metrics| metrics.k_means.map(|k_means| k_means.mpjpe_mm),
    },
    Metric {
        title: "Codes in use",
        label: "Utilisation (%)",
        scale: Scale::Linear,
        of: |metrics| 100.0 * metrics.utilisation,
        of_k_means: |_| None,
    },
    Metric {
        title: "Effective codes",
        label: "Exponential entropy (codes)",
        scale: Scale::Log,
        of: |metrics| metrics.exponential_entropy,
        of_k_means: |_| None,
    },
];

pub fn draw(sources: &Sources) -> Drawing {
    let tokenizers = sources.input.tokenizers;
    let vocabs = sorted(tokenizers.iter().map(|t| t.n_vocab));
    if vocabs.len() < 2 {
        let n = vocabs.len();
        return Err(format!("it needs tokenizers of two vocabulary sizes, there are {n}"));
    }
    let kinds = sorted(tokenizers.iter().map(TokenizerMetrics::name));
    let looks = category_looks(kinds.len());
    let plots = METRICS.iter().map(|metric| metric.plot(tokenizers, &vocabs, (&kinds, &looks)));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    Ok(page(sources, &kinds, &looks).panels(plots))
}

fn page(sources: &Sources, kinds: &[String], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Tokenizer");
    for (kind, look) in kinds.iter().zip(looks) {
        legend.entry(look.sample(), in_capitals(kind));
    }
    if sources.input.tokenizers.iter().any(|metrics| metrics.k_means.is_some()) {
        legend.entry(Sample::Line(k_means()), "k-means");
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound_stroke()), "all codes equal");
    let remarks = "Over the whole test split; a line joins the means at each V.".to_owned();
    let title = sources.title("tokenizers");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

impl Metric {
    fn plot(
        &self,
        tokenizers: &[TokenizerMetrics],
        vocabs: &[usize],
        (kinds, looks): (&[String], &[Look]),
    ) -> Result<Plot, String> {
        let k_means_values = tokenizers.iter().filter_map(self.of_k_means);
        let values = tokenizers.iter().map(self.of).chain(k_means_values);
        let vocabs = vocabs.iter().map(|&n_vocab| n_vocab as f64);
        let x = Axis::new("Vocabulary size V (codes)", Scale::Log, vocabs.clone())?;
        let y = Axis::new(self.label, self.scale, values)?;
        let mut plot = Plot::new([self.title.to_owned()], x.ticks_at(vocabs), y);
        if self.scale == Scale::Log {
            // exp H = V: no code is met more often than another.
            plot.curve(plot.x.ends(), |v| v, bound_stroke());
        }
        plot.line(means(tokenizers, self.of_k_means), k_means());
        for (kind, look) in kinds.iter().zip(looks) {
            let of_kind = tokenizers.iter().filter(|t| t.name() == *kind);
            plot.line(means(of_kind.clone(), |metrics| Some((self.of)(metrics))), look.stroke());
            for metrics in of_kind {
                plot.mark((metrics.n_vocab as f64, (self.of)(metrics)), look.mark());
            }
        }
        Ok(plot)
    }
}

/// The mean at each V that has a value, by V.
fn means<'a>(
    tokenizers: impl IntoIterator<Item = &'a TokenizerMetrics>,
    of: impl Fn(&TokenizerMetrics) -> Option<f64>,
) -> Vec<Point> {
    let mut by_vocab: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for (n_vocab, value) in tokenizers.into_iter().filter_map(|t| Some((t.n_vocab, of(t)?))) {
        by_vocab.entry(n_vocab).or_default().push(value);
    }
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    by_vocab.into_iter().map(|(n_vocab, values)| (n_vocab as f64, mean(values))).collect()
}

/// `patch VQ`: quantizers are abbreviations.
fn in_capitals(name: &str) -> String {
    match name.rsplit_once(' ') {
        Some((architecture, quantizer)) => format!("{architecture} {}", quantizer.to_uppercase()),
        None => name.to_uppercase(),
    }
}

/// What any tokenizer has to beat.
fn k_means() -> Stroke {
    Stroke::solid(MUTED, 1.6)
}
