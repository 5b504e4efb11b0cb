//! The macros that turn one table of parameters into a struct, its defaults, its descriptors and its access
//! by name.

use super::need::Need;
use super::value::{Descriptor, Value};

/// A set of parameters that can be reached by name. Made by [`group!`] and [`groups!`].
pub(crate) trait Group {
    /// Adds the descriptor of each parameter, in the order of the table.
    fn describe(out: &mut Vec<Descriptor>);
    /// The present value of the parameter.
    fn get(&self, name: &str) -> Option<Value>;
    /// Stores a value of the right type. `None`: no such parameter here; `Some(false)`: another type or choice.
    fn put(&mut self, name: &str, value: &Value) -> Option<bool>;
    /// Whether a parameter whose change needs this differs from that of `other`.
    fn differs(&self, other: &Self, need: Need) -> bool;
    /// Takes from `made` each parameter whose change waits: this set is then what is in force until it has been made
    /// anew.
    fn keep(&mut self, made: &Self);
}

/// One group: each row is `field: type = default, [in range,] [unit "unit",] [needs Need,] [is Tier;] "description";`.
/// What names no [`Need`](super::Need) needs nothing; what names no [`Tier`](super::Tier) is advanced.
macro_rules! group {
    (
        $(#[$meta:meta])*
        pub struct $name:ident at $prefix:literal {
            $($field:ident : $ty:ty = $default:expr
                $(, in $range:expr)? $(, unit $unit:literal)? $(, needs $need:ident)? $(, is $tier:ident)?
                ; $doc:literal)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $(#[doc = $doc] pub $field: $ty,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default.into(),)* }
            }
        }

        impl $crate::params::table::Group for $name {
            fn describe(out: &mut Vec<$crate::params::Descriptor>) {
                let defaults = Self::default();
                $(out.push($crate::params::Descriptor {
                    name: concat!($prefix, stringify!($field)),
                    default: $crate::params::value::Stored::to_value(&defaults.$field),
                    range: group!(@range $($range)?),
                    choices: <$ty as $crate::params::value::Stored>::CHOICES,
                    unit: concat!($($unit)?),
                    description: $doc,
                    need: group!(@need $($need)?),
                    tier: group!(@tier $($tier)?),
                });)*
            }

            fn get(&self, name: &str) -> Option<$crate::params::Value> {
                match name {
                    $(concat!($prefix, stringify!($field)) =>
                        Some($crate::params::value::Stored::to_value(&self.$field)),)*
                    _ => None,
                }
            }

            fn put(&mut self, name: &str, value: &$crate::params::Value) -> Option<bool> {
                match name {
                    $(concat!($prefix, stringify!($field)) => Some(
                        match $crate::params::value::Stored::from_value(value) {
                            Some(v) => { self.$field = v; true }
                            None => false,
                        }),)*
                    _ => None,
                }
            }

            fn differs(&self, other: &Self, need: $crate::params::Need) -> bool {
                false $(|| (group!(@need $($need)?) == need && self.$field != other.$field))*
            }

            fn keep(&mut self, made: &Self) {
                $(if group!(@need $($need)?).waits() {
                    self.$field = made.$field.clone();
                })*
            }
        }
    };
    (@need) => { $crate::params::Need::Nothing };
    (@need $need:ident) => { $crate::params::Need::$need };
    (@tier) => { $crate::params::Tier::Advanced };
    (@tier $tier:ident) => { $crate::params::Tier::$tier };
    (@range) => { None };
    (@range $range:expr) => { Some($crate::params::Range::from($range)) };
}

/// A group of groups: `field: Type,` for each.
macro_rules! groups {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            $($(#[$field_meta:meta])* $field:ident : $ty:ty,)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Default)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $ty,)*
        }

        impl $crate::params::table::Group for $name {
            fn describe(out: &mut Vec<$crate::params::Descriptor>) {
                $(<$ty as $crate::params::table::Group>::describe(out);)*
            }

            fn get(&self, name: &str) -> Option<$crate::params::Value> {
                None$(.or_else(|| self.$field.get(name)))*
            }

            fn put(&mut self, name: &str, value: &$crate::params::Value) -> Option<bool> {
                None$(.or_else(|| self.$field.put(name, value)))*
            }

            fn differs(&self, other: &Self, need: $crate::params::Need) -> bool {
                false $(|| self.$field.differs(&other.$field, need))*
            }

            fn keep(&mut self, made: &Self) {
                $(self.$field.keep(&made.$field);)*
            }
        }
    };
}

/// An enum that is stored as one of a few strings.
macro_rules! choice {
    (
        $(#[$meta:meta])*
        pub enum $name:ident { $($(#[$variant_meta:meta])* $variant:ident = $text:literal,)* }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$variant_meta])* $variant,)* }

        impl $name {
            /// The string that stands for it.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl $crate::params::value::Stored for $name {
            const CHOICES: &'static [&'static str] = &[$($text,)*];

            fn to_value(&self) -> $crate::params::Value {
                $crate::params::Value::String(self.name().to_owned())
            }

            fn from_value(value: &$crate::params::Value) -> Option<Self> {
                match value {
                    $($crate::params::Value::String(v) if v == $text => Some(Self::$variant),)*
                    _ => None,
                }
            }
        }
    };
}

pub(super) use {choice, group, groups};
