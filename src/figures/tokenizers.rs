//! Reconstruction and codebook use of the tokenizers against V (ScaMo Fig. 6).

use crate::tokenizer::TokenizerMetrics;

use super::axis::{Axis, Scale};
use super::colour::MUTED;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Dash, Point, Scene, Stroke};
use super::series::{Look, category_looks};
use super::{Drawing, Sources};

/// One panel: its title, the name of its axis, its values.
struct Metric {
    title: &'static str,
    label: &'static str,
    scale: Scale,
    of: fn(&TokenizerMetrics) -> f64,
}

const METRICS: [Metric; 4] = [
    Metric {
        title: "Reconstruction",
        label: "L1 of normalised features",
        scale: Scale::Linear,
        of: |metrics| metrics.reconstruction_l1,
    },
    Metric {
        title: "Joint positions",
        label: "MPJPE (mm)",
        scale: Scale::Linear,
        of: |metrics| metrics.mpjpe_mm,
    },
    Metric {
        title: "Codes in use",
        label: "Utilisation (%)",
        scale: Scale::Linear,
        of: |metrics| 100.0 * metrics.utilisation,
    },
    Metric {
        title: "Effective codes",
        label: "Exponential entropy (codes)",
        scale: Scale::Log,
        of: |metrics| metrics.exponential_entropy,
    },
];

pub fn draw(sources: &Sources) -> Drawing {
    let tokenizers = sources.input.tokenizers;
    let vocabs = vocabs(tokenizers);
    if vocabs.len() < 2 {
        return Err(format!(
            "it needs tokenizers of two vocabulary sizes, there are {}",
            vocabs.len()
        ));
    }
    let kinds = kinds(tokenizers);
    let looks = category_looks(kinds.len());
    let plots = METRICS.iter().map(|metric| metric.plot(tokenizers, &vocabs));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let (mut scene, panels) = page(sources, &kinds, &looks).panels(plots);
    for (metric, panel) in METRICS.iter().zip(&panels) {
        metric.draw(&mut scene, panel, tokenizers, (&kinds, &looks));
    }
    Ok(scene)
}

fn page(sources: &Sources, kinds: &[&str], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Tokenizer");
    for (kind, look) in kinds.iter().zip(looks) {
        legend.entry(look.sample(), kind.to_uppercase());
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound()), "all codes equal");
    let remarks = "Over the whole test split; a line joins the means at each V.".to_owned();
    let title = sources.title("tokenizers");
    Page { width: 1000.0, height: 700.0, title, remarks, legend }
}

impl Metric {
    fn plot(&self, tokenizers: &[TokenizerMetrics], vocabs: &[f64]) -> Result<Plot, String> {
        let values = tokenizers.iter().map(self.of);
        let x = Axis::new("Vocabulary size V (codes)", Scale::Log, vocabs.iter().copied())?;
        let y = Axis::new(self.label, self.scale, values)?;
        let x = x.ticks_at(vocabs.iter().copied());
        Ok(Plot { title: vec![self.title.to_owned()], x, y })
    }

    fn draw(
        &self,
        scene: &mut Scene,
        panel: &Panel,
        tokenizers: &[TokenizerMetrics],
        (kinds, looks): (&[&str], &[Look]),
    ) {
        panel.backdrop(scene);
        if self.scale == Scale::Log {
            panel.curve(scene, (panel.x.value(0.0), panel.x.value(1.0)), |v| v, bound());
        }
        for (kind, look) in kinds.iter().zip(looks) {
            let of_kind: Vec<_> = tokenizers.iter().filter(|t| t.kind == *kind).collect();
            panel.line(scene, &self.means(&of_kind), look.stroke());
            for metrics in of_kind {
                let at = (metrics.n_vocab as f64, (self.of)(metrics));
                panel.mark(scene, at, look.mark());
            }
        }
    }

    /// The mean at each V, by V.
    fn means(&self, tokenizers: &[&TokenizerMetrics]) -> Vec<Point> {
        let mut vocabs: Vec<_> = tokenizers.iter().map(|t| t.n_vocab).collect();
        vocabs.sort_unstable();
        vocabs.dedup();
        let mean = |n_vocab| {
            let values: Vec<f64> =
                tokenizers.iter().filter(|t| t.n_vocab == n_vocab).map(|t| (self.of)(t)).collect();
            (n_vocab as f64, values.iter().sum::<f64>() / values.len() as f64)
        };
        vocabs.into_iter().map(mean).collect()
    }
}

/// exp H = V: no code is met more often than another.
fn bound() -> Stroke {
    Stroke::solid(MUTED, 1.3).dash(Dash::Dashed)
}

fn vocabs(tokenizers: &[TokenizerMetrics]) -> Vec<f64> {
    let mut vocabs: Vec<_> = tokenizers.iter().map(|t| t.n_vocab).collect();
    vocabs.sort_unstable();
    vocabs.dedup();
    vocabs.into_iter().map(|n_vocab| n_vocab as f64).collect()
}

fn kinds(tokenizers: &[TokenizerMetrics]) -> Vec<&str> {
    let mut kinds: Vec<_> = tokenizers.iter().map(|t| t.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds
}
