//! [`table`]: rows of text with a caption.

use maud::{Markup, html};

use crate::words::from_to;

/// A table whose first column names its rows; it scrolls by itself where it is wider than the page.
pub fn table(caption: &str, head: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        div.wide tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for name in head { th scope="col" { (name) } } } }
                tbody {
                    @for row in rows {
                        tr {
                            @for (column, cell) in row.iter().enumerate() {
                                @if column == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// An interval in words; empty if there is none.
pub fn interval(interval: Option<[f64; 2]>, number: fn(f64) -> String) -> String {
    interval.map_or_else(String::new, |ends| from_to(ends, number))
}
