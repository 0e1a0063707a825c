//! Why runs are advised.

use crate::laws::input::method::MinimumMethod;
use crate::laws::words::text::count;

/// Why runs are advised.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) enum Why {
    SizeAtEdge {
        largest: bool,
    },
    VocabularyAtEdge {
        largest: bool,
    },
    /// The sizes on either side of the minimum.
    Gap(f64, f64),
    /// Sizes, too few for the curve.
    FewSizes(usize, MinimumMethod),
    Flat,
    NoMinimum,
    /// The next budget: exponents with intervals of these widths, and the optimal size there.
    Next {
        wide: Vec<(&'static str, f64)>,
        size: &'static str,
        centre: f64,
    },
}

impl Why {
    /// The end of a sentence.
    pub fn phrase(&self) -> String {
        let side = |largest: &bool| if *largest { "largest" } else { "smallest" };
        match self {
            Self::SizeAtEdge { largest } => {
                format!("the minimum lies at or beyond the {} size tried", side(largest))
            }
            Self::VocabularyAtEdge { largest } => {
                format!("the best vocabulary is the {} tried", side(largest))
            }
            Self::Gap(left, right) => format!(
                "the minimum lies between {} and {}, a factor {:.1} apart",
                count(*left),
                count(*right),
                right / left
            ),
            Self::FewSizes(sizes, method) => {
                format!("{sizes} size(s) are too few for the {method}")
            }
            Self::Flat => seeds("is flat within its noise"),
            Self::NoMinimum => seeds("has no minimum, which noise may explain"),
            Self::Next { wide, size, centre } => {
                let wide = wide.iter().map(|(name, width)| {
                    format!("the interval of the exponent of {name} is {width:.2} wide")
                });
                let wide = wide.collect::<Vec<_>>().join(" and ");
                let semicolon = if wide.is_empty() { "" } else { "; " };
                format!("{wide}{semicolon}the laws put its optimum at {size} = {}", count(*centre))
            }
        }
    }
}

fn seeds(what: &str) -> String {
    format!("the curve {what}; as many seeds again reduce the noise by a factor 1.4")
}
