//! Sections of a sweep file, of which every key may be left out.

/// A section from a list of its keys, each with its default; a key is not written if it is `unless`.
#[macro_export]
macro_rules! section {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $(
                $(#[$of_key:meta])*
                $key:ident: $type:ty = $default:expr $(, unless $hidden:literal)?;
            )*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(
                $(#[$of_key])*
                #[serde(deserialize_with = "crate::units::number::read")]
                $(#[serde(skip_serializing_if = $hidden)])?
                pub $key: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }
    };
}
pub use section;

/// A spec with the keys that a section has written, and its defaults for those that it has not.
#[macro_export]
macro_rules! or_default {
    ($section:expr, $default:expr, $($key:ident),*) => {{
        let mut spec = $default;
        $(spec.$key = $section.$key.unwrap_or(spec.$key);)*
        spec
    }};
}
pub use or_default;

/// Whether a key has its default, which is then not written.
pub fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
