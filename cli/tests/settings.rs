//! Settings as `--set` takes them.

use drystone::SolverConfig;
use drystone_cli::settings::set;

#[test]
fn settings_out_of_their_range_are_refused_by_name() {
    for (name, good, bad) in [
        ("substeps", "1", "0"),
        ("substeps", "4096", "4097"),
        ("iterations", "1", "0"),
        ("relax", "0", "4097"),
        ("manifold_passes", "16", "17"),
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
