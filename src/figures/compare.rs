//! N_nv, N_v and D of several studies' optima against C.

use crate::laws::{LawSample, Laws, PowerLaw};

use super::axis::{Axis, Scale};
use super::fitted::{interval95, minima, power};
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Dash, Scene};
use super::series::{Look, category_looks, law_stroke};

/// A study: its name and its laws through all budgets.
pub type Study<'a> = (&'a str, &'a Laws);

struct Quantity {
    label: &'static str,
    law: fn(&Laws) -> Option<&PowerLaw>,
    of: fn(&crate::laws::Minimum) -> f64,
    sample: fn(&LawSample) -> (f64, f64),
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        label: "Non-vocabulary parameters Nₙᵥ",
        law: |laws| laws.power_laws.params_nonvocab.as_ref(),
        of: |minimum| minimum.params_nonvocab,
        sample: |sample| (sample.ln_nonvocab_at_reference, sample.exponent_nonvocab),
    },
    Quantity {
        label: "Vocabulary parameters Nᵥ",
        law: |laws| laws.power_laws.params_vocab.as_ref(),
        of: |minimum| minimum.params_vocab,
        sample: |sample| (sample.ln_vocab_at_reference, sample.exponent_vocab),
    },
    Quantity {
        label: "Training tokens D",
        law: |laws| laws.power_laws.tokens.as_ref(),
        of: |minimum| minimum.tokens,
        sample: |sample| (sample.ln_tokens_at_reference, sample.exponent_tokens),
    },
];

/// The page, or the reason why there is none.
pub fn draw(studies: &[Study]) -> Result<Scene, String> {
    let looks = category_looks(studies.len());
    let plots = QUANTITIES.iter().map(|quantity| quantity.plot(studies));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let (mut scene, panels) = page(studies, &looks).panels(plots);
    for (quantity, panel) in QUANTITIES.iter().zip(&panels) {
        panel.backdrop(&mut scene);
        for ((_, laws), look) in studies.iter().zip(&looks) {
            quantity.draw(&mut scene, panel, laws, *look);
        }
    }
    Ok(scene)
}

fn page(studies: &[Study], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Study");
    for ((name, _), look) in studies.iter().zip(looks) {
        legend.entry(Sample::MarkedLine(law_stroke(look.colour), look.mark()), *name);
    }
    legend.entry(Sample::Line(law_stroke(looks[0].colour).dash(Dash::Dashed)), "95 % interval");
    let title = "Optimal configurations of several studies".to_string();
    let remarks = "Lines are the power laws through all budgets, marks the minima.".to_string();
    Page { width: 1250.0, height: 440.0, title, remarks, legend }
}

impl Quantity {
    fn plot(&self, studies: &[Study]) -> Result<Plot, String> {
        let points = studies.iter().flat_map(|(_, laws)| {
            minima(laws).into_iter().map(|(minimum, _)| (minimum.budget_flops, (self.of)(minimum)))
        });
        let points: Vec<(f64, f64)> = points.collect();
        if points.is_empty() {
            return Err("no study holds a minimum".to_string());
        }
        Ok(Plot {
            title: Vec::new(),
            x: Axis::new("Training compute C (FLOPs)", Scale::Log, points.iter().map(|p| p.0))?,
            y: Axis::new(self.label, Scale::Log, points.iter().map(|p| p.1))?,
        })
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, laws: &Laws, look: Look) {
        let stroke = law_stroke(look.colour);
        let ends = (panel.x.value(0.0), panel.x.value(1.0));
        if let Some(law) = (self.law)(laws) {
            panel.curve(scene, ends, |flops| power(law, flops), stroke);
        }
        if !laws.bootstrap.is_empty() {
            let end = |flops: f64| {
                let ln_ratio = (flops / laws.reference_flops).ln();
                interval95(&laws.bootstrap, |sample| {
                    let (ln_at_reference, exponent) = (self.sample)(sample);
                    (ln_at_reference + exponent * ln_ratio).exp()
                })
            };
            panel.curve(scene, ends, |flops| end(flops).0, stroke.dash(Dash::Dashed));
            panel.curve(scene, ends, |flops| end(flops).1, stroke.dash(Dash::Dashed));
        }
        for (minimum, _) in minima(laws) {
            panel.mark(scene, (minimum.budget_flops, (self.of)(minimum)), look.mark());
        }
    }
}
