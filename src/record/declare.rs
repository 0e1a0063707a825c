//! The macro behind [`facts`](super::facts).

/// Makes of one list of facts the structs [`Planned`](super::Planned) and
/// [`Measured`](super::Measured), a constant for each loss and their list, and the columns of the
/// table.
///
/// A line is `planned name: Type,`, `measured name: Type,` or `loss NAME = "name",`. The macro takes a
/// line off the list at a time and puts it into one of four heaps: fields of each struct, losses,
/// columns.
macro_rules! facts {
    (@heap {$($planned:tt)*} {$($measured:tt)*}
     {$($(#[$doc:meta])* $loss:ident = $name:expr;)*} {$($columns:tt)*}) => {
        /// Facts that the plan of a run holds before it starts.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct Planned { $($planned)* }

        /// Facts that training adds: what the run spent, where and on what.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct Measured { $($measured)* }

        $($(#[$doc])* pub const $loss: &str = $name;)*

        /// The metrics that are a loss; a record holds at least one of them.
        pub const LOSSES: &[&str] = &[$($loss),*];

        /// The columns of the table, in its order.
        pub const COLUMNS: &[FactColumn] = &[$($columns)*];
    };
    (@heap {$($planned:tt)*} $measured:tt $losses:tt {$($columns:tt)*}
     $(#[$doc:meta])* planned $name:ident: $type:ident $(<$of:ident>)?, $($rest:tt)*) => {
        facts! {
            @heap {$($planned)* $(#[$doc])* pub $name: $type $(<$of>)?,} $measured $losses
            {$($columns)* facts!(@column $name $type $(<$of>)?),} $($rest)*
        }
    };
    (@heap $planned:tt {$($measured:tt)*} $losses:tt {$($columns:tt)*}
     $(#[$doc:meta])* measured $name:ident: $type:ident $(<$of:ident>)?, $($rest:tt)*) => {
        facts! {
            @heap $planned {$($measured)* $(#[$doc])* pub $name: $type $(<$of>)?,} $losses
            {$($columns)* facts!(@column $name $type $(<$of>)?),} $($rest)*
        }
    };
    (@heap $planned:tt $measured:tt {$($losses:tt)*} {$($columns:tt)*}
     $(#[$doc:meta])* loss $loss:ident = $name:expr, $($rest:tt)*) => {
        facts! {
            @heap $planned $measured {$($losses)* $(#[$doc])* $loss = $name;}
            {$($columns)* facts!(@metric $loss),} $($rest)*
        }
    };
    // One that is no `Option` is required.
    (@column $name:ident Option<$type:ident>) => {
        FactColumn { name: stringify!($name), kind: facts!(@kind $type), is_required: false }
    };
    (@column $name:ident $type:ident) => {
        FactColumn { name: stringify!($name), kind: facts!(@kind $type), is_required: true }
    };
    (@kind f64) => { CellKind::Number };
    (@kind String) => { CellKind::Text };
    (@kind $count:ident) => { CellKind::Count };
    (@metric $name:ident) => {
        FactColumn { name: $name, kind: CellKind::Number, is_required: false }
    };
    ($($facts:tt)*) => {
        facts! { @heap {} {} {} {} $($facts)* }
    };
}

pub(super) use facts;
