//! From any table of runs made elsewhere to [`IsoFlopPoint`](crate::laws::IsoFlopPoint)s.
//!
//! `file → Table → quantities → derived quantities → rows kept and rows dropped`
//!
//! | step | function |
//! | --- | --- |
//! | a CSV, TSV or Parquet file into columns | [`read()`] |
//! | `7M`, `1,5e7` and other written numbers | `written` |
//! | `Model Size*1e6`, `loss < 4 and not outlier` | [`Expression::parse`] |
//! | `--columns` into the quantities a law knows | `columns` |
//! | the quantities that follow from the others | `derive` |
//! | the groups of a column | [`groups()`] |
//! | rows that cannot be trusted | [`OutlierStage::split`] |
//! | all of it | [`load`] |
//!
//! # Example
//!
//! ```
//! use isoflop_laws::table::{self, TableRequest};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("theirs.csv");
//! std::fs::write(&path, "size_m,C,ce\n10,1e17,3.9\n20,1e17,3.7\n40,1e17,3.8\n")?;
//! let columns = Some("params=size_m*1e6,budget_flops=C,loss=ce".to_string());
//! let request = TableRequest { columns, ..TableRequest::default() };
//! let loaded = table::load(&table::read(&path)?, &request)?;
//! // D follows from C = 6ND.
//! assert_eq!(loaded.points[0].tokens, 1e17 / (6.0 * 1e7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod columns;
mod csv;
mod derive;
mod drop_stage;
mod error;
mod expression;
mod group;
mod groups;
mod mixed;
mod model;
mod nearest;
mod outliers;
#[cfg(feature = "parquet")]
mod pages;
#[cfg(feature = "parquet")]
mod parquet;
mod point;
mod quantity;
#[cfg(feature = "parquet")]
mod quiet;
mod read;
mod records;
mod rows;
mod types;
mod written;

pub use drop_stage::DropStage;
pub use error::{ReadProblem, TableError};
pub use expression::{Expression, ExpressionError, ExpressionProblem};
pub use group::Group;
pub use groups::groups;
pub use nearest::UnknownName;
pub use outliers::OutlierStage;
pub use quantity::Quantity;
pub use read::{ReadError, read};
pub use rows::{Dropped, Loaded, TableRequest, load};
pub use types::{Column, Table};
pub use written::number;
