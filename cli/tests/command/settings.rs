//! Settings of `--set`.

use drystone::SolverConfig;
use drystone::config::FrictionRule;
use drystone_cli::settings::{read, set, unusual};

/// The page has the schema as a file, so that its module need not carry what makes it.
#[test]
fn the_page_has_the_schema_of_the_settings() {
    let program = env!("CARGO_BIN_EXE_drystone");
    let output = std::process::Command::new(program).args(["settings", "--schema"]).output().expect("the program");
    let printed = String::from_utf8(output.stdout).expect("text");
    let file = include_str!("../../../web/src/settings.json");
    assert!(printed == file, "drystone settings --schema > web/src/settings.json");
}

#[test]
fn settings_out_of_their_range_are_refused_by_name() {
    for (name, good, bad) in [
        ("substeps", "1", "0"),
        ("substeps", "4096", "4097"),
        ("iterations", "1", "0"),
        ("relax", "0", "4097"),
        ("rules.manifold_passes", "16", "17"),
        ("max_colors", "64", "65"),
        ("max_colors", "1", "0"),
        ("baumgarte", "1", "1.1"),
        ("slop", "0", "-0.1"),
        ("relaxation", "2", "2.1"),
        ("tolerance", "0.1", "nan"),
        ("joint_frequency", "0.5", "0.6"),
        ("joint_damping", "0", "-1"),
        ("contact_frequency", "0.5", "0.6"),
        ("contact_damping", "1e6", "2e6"),
        ("fixed_contact_frequency_ratio", "1e3", "2e3"),
        ("preload_rate", "1e3", "2e3"),
        ("push_limit", "1e9", "2e9"),
        ("restitution_threshold", "0", "-1"),
        ("speculative_margin", "1e3", "inf"),
        ("sleep_after", "1e6", "2e6"),
        ("sleep_speed", "1e3", "2e3"),
        ("recycle_distance", "0", "-1"),
    ] {
        let mut config = SolverConfig::default().without_sleep();
        set(&mut config, &format!("{name}={good}")).unwrap_or_else(|e| panic!("{e}"));
        let before = config.clone();
        let refusal = set(&mut config, &format!("{name}={bad}")).expect_err(name).to_string();
        assert!(refusal.contains(&format!("{name} = ")) && !refusal.contains('\n'), "{refusal}");
        assert_eq!(config, before, "what is refused changes nothing");
    }
}

/// The former names of settings that are now in a table.
#[test]
fn the_message_for_a_former_name_names_the_new_one() {
    let folder = tempfile::tempdir().expect("a folder");
    for (key, value, place) in [
        ("friction_order", "friction-first", "rules.friction_order"),
        ("clamping", "per-correction", "rules.clamping"),
        ("manifold_passes", "2", "rules.manifold_passes"),
        ("friction", "slip", "rules.slip_friction=true"),
    ] {
        let refusal = set(&mut SolverConfig::default(), &format!("{key}={value}")).expect_err(key).to_string();
        assert!(refusal.ends_with(&format!("set {place}")) && !refusal.contains('\n'), "{refusal}");
        let path = folder.path().join("old.toml");
        std::fs::write(&path, format!("substeps = 4\n{key} = {:?}\n", value)).expect("a file");
        let refusal = read(&path).expect_err(key).to_string();
        assert!(refusal.contains("old.toml: line 2: ") && refusal.ends_with(&format!("set {place}")), "{refusal}");
    }
}

#[test]
fn a_rule_for_comparison_is_set_and_printed_by_its_path() {
    let mut config = SolverConfig::default();
    set(&mut config, "rules.slip_friction=true").expect("a setting");
    set(&mut config, "rules.manifold_passes = 3").expect("a setting");
    assert_eq!((config.friction_rule(), config.rules.manifold_passes), (FrictionRule::Slip, 3));
    assert_eq!(unusual(&config, &[]), ["rules.manifold_passes=3", "rules.slip_friction=true"]);
    for bad in ["rules.nothing=1", "rules=1", "nothing.clamping=accumulated", "rules.clamping.more=1"] {
        let refusal = set(&mut config, bad).expect_err(bad).to_string();
        assert!(refusal.starts_with(&format!("--set {bad}: ")) && !refusal.contains('\n'), "{refusal}");
    }
}
