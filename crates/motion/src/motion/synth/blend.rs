//! Structs of numbers that blend, and the curves that they blend along.

/// Declares a struct of `f32` fields with element-wise operations.
macro_rules! blendable {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* $field:ident,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $($(#[$field_meta])* pub $field: f32,)* }

        impl $name {
            /// Fills the fields in their order.
            pub fn from_fn(mut value: impl FnMut() -> f32) -> Self {
                Self { $($field: value(),)* }
            }

            /// Combines two values field by field.
            pub fn zip(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
                Self { $($field: combine(self.$field, other.$field),)* }
            }

            /// `self` at weight 0, `other` at weight 1.
            pub fn mix(self, other: Self, weight: f32) -> Self {
                self.zip(other, |a, b| a + (b - a) * weight)
            }
        }
    };
}

/// 0 before 0, 1 after 1, and `3u² - 2u³` between.
pub fn smooth(u: f32) -> f32 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Rises from 0 to 1 over `ramp` after 0 and falls back to 0 over `ramp` before `end`.
pub fn plateau(t: f32, end: f32, ramp: f32) -> f32 {
    smooth(t / ramp) * smooth((end - t) / ramp)
}

/// The parabola that is 0 at 0 and at 1 and 1 half-way, and 0 outside.
pub fn arch(u: f32) -> f32 {
    (4.0 * u * (1.0 - u)).max(0.0)
}
