//! The names of kinds in files, on command lines and in messages.

/// Gives a kind without fields one name a value: `ALL`, `name`, `Display`, `FromStr`.
macro_rules! named {
    ($kind:ident { $($value:ident = $name:literal,)+ }) => {
        impl $kind {
            /// All, in their order.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

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
            type Err = $crate::error::Error;

            fn from_str(name: &str) -> $crate::error::Result<Self> {
                let unknown = || $crate::error::Error::input(format!("{name:?} is none of {}", [$($name),+].join(", ")));
                Self::ALL.into_iter().find(|value| value.name() == name).ok_or_else(unknown)
            }
        }
    };
}
pub(crate) use named;

#[cfg(test)]
mod tests {
    use crate::backend::{BackendChoice, Numbers};
    use crate::config::{Method, Stabilization};
    use crate::preset::Preset;
    use crate::solver::Order;

    #[test]
    fn a_name_is_read_back_and_another_is_refused_with_the_list() {
        assert!(Preset::ALL.into_iter().all(|value| value.name().parse::<Preset>().ok() == Some(value)));
        assert!(Numbers::ALL.into_iter().all(|value| value.name().parse::<Numbers>().ok() == Some(value)));
        assert!(Stabilization::ALL.into_iter().all(|value| value.name().parse::<Stabilization>().ok() == Some(value)));
        assert_eq!(format!("{:>9}", Order::Contacts), " contacts");
        let message = "gauss".parse::<Method>().expect_err("no method").to_string();
        assert_eq!(message, "\"gauss\" is none of plain, accelerated");
        assert_eq!("auto".parse::<BackendChoice>().expect("a choice"), BackendChoice::Auto);
    }

    #[cfg(feature = "serde")]
    #[test]
    fn serde_knows_the_same_names() {
        fn same<T: serde::Serialize + std::fmt::Display>(all: impl IntoIterator<Item = T>) {
            for value in all {
                assert_eq!(serde_json::to_value(&value).expect("a word"), value.to_string());
            }
        }
        same(Preset::ALL);
        same(Order::ALL);
        same(Method::ALL);
        same(Stabilization::ALL);
        same(Numbers::ALL);
    }
}
