//! Names of enum values in files, on command lines and in messages.

/// Gives each value of an enum without fields one name: `ALL`, `name`, `Display`, `FromStr`. The tests of this
/// repository use it too.
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($kind:ident { $($value:ident = $name:literal,)+ }) => {
        impl $kind {
            /// All values, in order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Names of the values.
            pub(crate) const NAMES: [&'static str; Self::ALL.len()] = [$($name),+];

            /// Its name in files, on command lines and in messages.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name,)+
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.name().fmt(f)
            }
        }

        impl std::str::FromStr for $kind {
            type Err = $crate::Error;

            fn from_str(name: &str) -> $crate::Result<Self> {
                let unknown = || $crate::Error::input(format!("{name:?}: must be one of {}", Self::NAMES.join(", ")));
                Self::ALL.into_iter().find(|value| value.name() == name).ok_or_else(unknown)
            }
        }
    };
}
pub(crate) use named;
