//! The tokenizers of a sweep in comparison, and the codes of one.

use std::collections::BTreeMap;

use super::axis::{Axis, Scale};
use super::cells::{Drawing, Sources, sorted};
use super::legend::{Legend, Look, Sample, bound_stroke, category_looks, ordered_looks};
use super::page::Page;
use super::panel::Plot;
use super::scene::{Mark, Marker, Point, Stroke};
use super::style::MUTED;
use crate::codes::{CodeMap, ScaleCodes, TokenizerMetrics};

/// One panel: its title, the name of its axis, its values.
struct Metric {
    title: &'static str,
    label: &'static str,
    scale: Scale,
    of: fn(&TokenizerMetrics) -> Option<f64>,
    /// The same of k-means with as many codes, where it was measured.
    of_k_means: fn(&TokenizerMetrics) -> Option<f64>,
}

const METRICS: [Metric; 7] = [
    Metric {
        title: "Reconstruction",
        label: "L1 of normalised features",
        scale: Scale::Linear,
        of: |metrics| Some(metrics.reconstruction_l1),
        of_k_means: |_| None,
    },
    Metric {
        title: "Joint positions",
        label: "MPJPE (mm)",
        scale: Scale::Linear,
        of: |metrics| Some(metrics.mpjpe_mm),
        of_k_means: |metrics| metrics.k_means.map(|k_means| k_means.mpjpe_mm),
    },
    Metric {
        title: "Codes in use",
        label: "Utilisation (%)",
        scale: Scale::Linear,
        of: |metrics| Some(100.0 * metrics.utilisation),
        of_k_means: |_| None,
    },
    Metric {
        title: "Effective codes",
        label: "Exponential entropy (codes)",
        scale: Scale::Log,
        of: |metrics| Some(metrics.exponential_entropy),
        of_k_means: |_| None,
    },
    Metric {
        title: "Boundaries of codes",
        label: "Step ratio (truth: 1)",
        scale: Scale::Linear,
        of: |metrics| metrics.continuity?.boundary_step_ratio,
        of_k_means: |_| None,
    },
    Metric {
        title: "Jerk",
        label: "Jerk ratio (truth: 1)",
        scale: Scale::Linear,
        of: |metrics| metrics.continuity?.jerk_ratio,
        of_k_means: |_| None,
    },
    Metric {
        title: "Root at the end",
        label: "Distance (% of the path)",
        scale: Scale::Linear,
        of: |metrics| Some(100.0 * metrics.continuity?.root_end_error?),
        of_k_means: |_| None,
    },
];

/// Reconstruction and codebook use of the tokenizers against V (ScaMo Fig. 6).
pub fn tokenizers(sources: &Sources) -> Drawing {
    let tokenizers = sources.input.tokenizers;
    let vocabs = sorted(tokenizers.iter().map(|t| t.n_vocab));
    if vocabs.len() < 2 {
        let n = vocabs.len();
        return Err(format!("it needs tokenizers of two vocabulary sizes, there are {n}"));
    }
    let kinds = sorted(tokenizers.iter().map(TokenizerMetrics::name));
    let looks = category_looks(kinds.len());
    // Files of older versions lack some.
    let measured =
        METRICS.iter().filter(|metric| tokenizers.iter().any(|t| (metric.of)(t).is_some()));
    let plots = measured.map(|metric| metric.plot(tokenizers, &vocabs, (&kinds, &looks)));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let mut legend = Legend::headed("Tokenizer");
    for (kind, look) in kinds.iter().zip(&looks) {
        legend.entry(look.sample(), in_capitals(kind));
    }
    if tokenizers.iter().any(|metrics| metrics.k_means.is_some()) {
        legend.entry(Sample::Line(k_means()), "k-means");
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound_stroke()), "all codes equal");
    let remarks = "Over the whole test split; a line joins the means at each V.".to_owned();
    let title = sources.title("tokenizers");
    Ok(Page { width: 1000.0, height: 700.0, title, remarks, legend }.panels(plots))
}

impl Metric {
    fn plot(
        &self,
        tokenizers: &[TokenizerMetrics],
        vocabs: &[usize],
        (kinds, looks): (&[String], &[Look]),
    ) -> Result<Plot, String> {
        let k_means_values = tokenizers.iter().filter_map(self.of_k_means);
        let values = tokenizers.iter().filter_map(self.of).chain(k_means_values);
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
            plot.line(means(of_kind.clone(), self.of), look.stroke());
            let point = |own: &TokenizerMetrics| Some((own.n_vocab as f64, (self.of)(own)?));
            plot.marks(of_kind.filter_map(point), *look);
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

/// The baseline.
fn k_means() -> Stroke {
    Stroke::solid(MUTED, 1.6)
}

// The codes of one.

/// The codes of a tokenizer, scale by scale: their frequencies and embeddings (LG-Tok, Figs. 6 and 7); or the reason
/// why there is no page.
pub fn codes(title: &str, map: &CodeMap) -> Drawing {
    // Scales are many and overlap: circles, dark to light.
    let circle = |look| Look { marker: Marker::Circle, ..look };
    let looks: Vec<_> = ordered_looks(map.scales.len()).into_iter().map(circle).collect();
    let plots = vec![use_plot(map, &looks)?, map_plot(map, &looks)?];
    let mut legend = Legend::headed("Scale: codes in use");
    for (i, (scale, look)) in map.scales.iter().zip(&looks).enumerate() {
        let (all, used) = (scale.places.len(), scale.met.utilisation());
        legend.entry(look.sample(), format!("{}: {:.0} % of {all}", i + 1, 100.0 * used));
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound_stroke()), "all codes alike");
    let remarks = "Codes of the test split. Left: a code's share of its scale's, times the size of the \
                   codebook. Right: the embeddings of the codes that were met, a mark the larger the \
                   more often."
        .to_owned();
    let title = title.to_owned();
    Ok(Page { width: 1100.0, height: 560.0, title, remarks, legend }.panels(plots))
}

fn use_plot(map: &CodeMap, looks: &[Look]) -> Result<Plot, String> {
    let lines: Vec<Vec<Point>> = map.scales.iter().map(by_rank).collect();
    let label = "Codes of a scale, the most frequent first (%)";
    let x = Axis::new(label, Scale::Linear, [0.0, 100.0])?;
    let frequencies = lines.iter().flatten().map(|point| point.1);
    let y = Axis::new("Frequency (1: all alike)", Scale::Log, frequencies.chain([1.0]))?;
    let mut plot = Plot::new(["Use".to_owned()], x, y);
    plot.line([(0.0, 1.0), (100.0, 1.0)], bound_stroke());
    lines.into_iter().zip(looks).for_each(|(line, look)| plot.line(line, look.stroke()));
    Ok(plot)
}

fn map_plot(map: &CodeMap, looks: &[Look]) -> Result<Plot, String> {
    let axis = |i: usize| {
        let met = map.scales.iter().flat_map(ScaleCodes::that_were_met);
        let order = ["First", "Second"][i];
        let label = format!("{order} component ({:.0} % of variance)", 100.0 * map.explained[i]);
        Axis::new(&label, Scale::Linear, met.map(|(place, _)| place[i]))
    };
    let mut plot = Plot::new(["Embeddings".to_owned()], axis(0)?, axis(1)?);
    for (scale, look) in map.scales.iter().zip(looks) {
        for ([x, y], frequency) in scale.that_were_met() {
            // 2.4 of a code that is met as often as it would be if all were alike.
            let radius = (2.4 * frequency.sqrt()).clamp(0.8, 9.0);
            plot.mark((x, y), Mark { radius, ..look.mark() });
        }
    }
    Ok(plot)
}

/// Frequencies of the codes that were met, falling, in units of that which all would have if they were
/// alike, against the share of the codebook.
fn by_rank(scale: &ScaleCodes) -> Vec<Point> {
    let mut frequencies: Vec<f64> = scale.that_were_met().map(|(_, frequency)| frequency).collect();
    frequencies.sort_unstable_by(|a, b| b.total_cmp(a));
    let all = scale.places.len() as f64;
    let point = |(rank, frequency)| (100.0 * (rank as f64 + 0.5) / all, frequency);
    frequencies.into_iter().enumerate().map(point).collect()
}
