//! What a fit is asked for: the command line, over the defaults of the analysis it follows.

use isoflop::laws::{
    Form, HoldOut, Huber, IsoFlopPoint, LawKind, MinimumMethod, ParametricOptions, Space, Starts,
};
use isoflop::table::TableRequest;

use super::args::{CompatName, FitArgs, TableArgs};

impl FitArgs {
    /// Of a table's rows and law alone.
    pub fn of_table(table: &TableArgs) -> Self {
        Self { table: table.clone(), ..Self::default() }
    }

    /// With what the published analysis has that is not given.
    pub fn resolved(&self) -> Self {
        let mut own = self.clone();
        if own.compat == Some(CompatName::Scamo) {
            own.minima.get_or_insert(MinimumMethod::Argmin);
            own.hold_out.get_or_insert(HoldOut::None);
            own.keep_flagged = true;
        }
        if own.compat == Some(CompatName::Epoch) {
            own.table.drop_highest.get_or_insert(5);
        }
        own
    }

    pub fn law(&self) -> LawKind {
        self.table.law.unwrap_or(match self.compat {
            Some(CompatName::Epoch) => LawKind::Parametric(Form::Approach3),
            Some(CompatName::Scamo) | None => LawKind::Isoflop,
        })
    }

    /// The rows of a table that count.
    pub fn rows(&self) -> TableRequest {
        let TableArgs { columns, filters, drop_highest, outliers, .. } = self.table.clone();
        let drop_highest = drop_highest.unwrap_or(0);
        TableRequest { columns, group: None, filters, drop_highest, outliers }
    }

    /// Whether a sweep's folder is taken as any other table.
    pub fn is_of_rows(&self) -> bool {
        self.rows() != TableRequest::default() || self.table.drop_highest.is_some()
    }

    /// Huber's δ of power laws, in MADs.
    pub fn huber_mads(&self) -> Option<f64> {
        match self.huber? {
            Huber::Delta(delta) | Huber::Mad(delta) => Some(delta),
            Huber::None => None,
        }
    }

    /// The options of a parametric law.
    pub fn parametric(&self, form: Form) -> ParametricOptions {
        let own = ParametricOptions::of(form);
        let epoch = self.compat == Some(CompatName::Epoch);
        let huber = if epoch { Huber::Delta(1e-3) } else { own.huber };
        ParametricOptions {
            huber: self.huber.unwrap_or(huber),
            space: self.space.unwrap_or(own.space),
            starts: self.starts.unwrap_or(if epoch { Starts::Grid } else { own.starts }),
            tied: self.tied,
            bootstrap: self.bootstrap.unwrap_or(if epoch { 4000 } else { own.bootstrap }),
            seed: self.seed.unwrap_or(own.seed),
            ..own
        }
    }

    /// A note if the loss itself is fitted for want of logarithms, its space not being asked for.
    pub fn raw_note(&self, points: &[IsoFlopPoint]) -> Option<String> {
        let LawKind::Parametric(form) = self.law() else { return None };
        let in_logs = self.space.is_none() && self.parametric(form).space == Space::Log;
        let below = points.iter().filter(|point| point.loss <= 0.0).count();
        (in_logs && below > 0).then(|| {
            format!(
                "{below} of {} losses are not above 0, so the loss itself is fitted, not its logarithm \
                 (--space raw)",
                points.len()
            )
        })
    }

    /// Budgets to give the optimum for: those asked for, else `largest` and ten times it.
    pub fn budgets(&self, largest: Option<f64>) -> Vec<f64> {
        match (self.predict.as_slice(), largest) {
            ([], Some(largest)) => vec![largest, 10.0 * largest],
            (asked, _) => asked.to_vec(),
        }
    }
}
