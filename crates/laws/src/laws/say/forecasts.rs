//! What became of forecasts that runs have tested.

use crate::laws::file::validated::{Inside, Validated};
use crate::laws::words::text::count;

impl Validated {
    /// What came of the forecast of the loss, in a sentence; none where no loss was forecast, and within the fit.
    pub fn sentence(&self) -> Option<String> {
        let is_forecast = self.extrapolation_factor > 1.0;
        let (loss, [low, high]) =
            (self.predicted.loss.filter(|_| is_forecast)?, self.predicted.loss_ci95?);
        let verdict = match self.inside.loss {
            Some(true) => "held",
            Some(false) => "MISSED",
            None => "is within the noise of its runs",
        };
        Some(format!(
            "A forecast for {} FLOPs {verdict}: L_u {loss:.3} (95 %: {low:.3} to {high:.3}), and the best of {} runs has {:.3}{}.",
            count(self.budget_flops),
            self.measured.runs,
            self.measured.loss,
            outside(&self.inside)
        ))
    }
}

/// What of the optimum lies outside its interval, as the end of a sentence; empty where nothing does.
fn outside(inside: &Inside) -> String {
    match &inside.outside().collect::<Vec<_>>()[..] {
        [] => String::new(),
        [one] => format!("; its {one} lies outside"),
        all => format!("; its {} lie outside", all.join(" and ")),
    }
}
