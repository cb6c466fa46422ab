//! The names of kinds in files, on command lines and in messages.

use drystone::backend::{BackendChoice, BackendKind};
use drystone::config::{Method, Stabilization};
use drystone::preset::Preset;
use drystone_problems::solver::Order;

#[test]
fn a_name_is_read_back_and_another_is_refused_with_the_list() {
    assert!(Preset::ALL.into_iter().all(|value| value.name().parse::<Preset>().ok() == Some(value)));
    assert!(BackendKind::ALL.into_iter().all(|value| value.name().parse::<BackendKind>().ok() == Some(value)));
    assert!(Stabilization::ALL.into_iter().all(|value| value.name().parse::<Stabilization>().ok() == Some(value)));
    assert_eq!(format!("{:>9}", Order::Contacts), " contacts");
    let message = "gauss".parse::<Method>().expect_err("no method").to_string();
    assert_eq!(message, "\"gauss\": must be one of plain, accelerated");
    assert_eq!("auto".parse::<BackendChoice>().expect("a choice"), BackendChoice::Auto);
}

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
    same(BackendKind::ALL);
}
