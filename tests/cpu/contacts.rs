//! Contact problems as text: what is written is read back, and what is wrong is named.

use crate::common::contacts::tower;
use drystone_problems::ContactProblem;
use glam::DVec3;

/// A problem that has no zero and no round number where one could be mistaken for another.
fn odd() -> ContactProblem {
    let mut problem = tower(&[1.0 / 3.0, 7e-13, 5e20]);
    problem.bodies[1].inertia.y_axis.x = -1e-14;
    problem.bodies[1].inertia.x_axis.y = -1e-14;
    problem.bodies[2].free.angular = DVec3::new(0.1, -0.2, 0.3) / 7.0;
    problem.contacts[5].offset = DVec3::new(-1e-9, 2e-9, 3e300);
    problem.contacts[7].b = None;
    problem
}

#[test]
fn what_is_written_is_read_back_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("odd.contacts");
    std::fs::write(&path, odd().to_text()).expect("written");
    let read = ContactProblem::read(&path).expect("read");
    assert_eq!(read, odd());
    let mut other = odd();
    other.contacts[5].r_b.y += 1e-16;
    assert_ne!(read, other, "a difference of one bit is seen");
}

/// A line of a tower of two, what is put in its place, and what the error must name.
const REFUSED: &[(usize, &str, &[&str])] = &[
    (1, "contacts 2", &["version 2"]),
    (1, "scene 1", &["\"scene\"", "\"contacts\""]),
    (3, "bodies 2 contacts x", &["number of contacts \"x\""]),
    (3, "bodies 2 contacts", &["ends where number of contacts"]),
    (3, "bodies -2 contacts 8", &["number of bodies \"-2\""]),
    (3, "bodies 4000000000 contacts 8", &["\"c\" where \"b\""]),
    (3, "bodies 1 contacts 8", &["\"b\" where \"c\""]),
    (3, "bodies 2 contacts 7", &["after the last contact"]),
    (4, "b 0 1 0 0 1 0 1 0 0 0 0 0 0", &["mass 0.0", "more than 0"]),
    (4, "b 1 1 2 0 1 0 1 0 0 0 0 0 0", &["inertia [1.0, 2.0", "positive definite"]),
    (4, "b 1 0 0 0 1 0 1 0 0 0 0 0 0", &["inertia [0.0", "positive definite"]),
    (4, "b 1 1 0 0 1 0 1 0 0 0 0 nan 0", &["angular velocity NaN", "finite"]),
    (4, "b 1 1 0 0 1 0 1 0 0 0 0 0", &["ends where angular velocity"]),
    (4, "b 1 1 0 0 1 0 1 0 0 0 0 0 0 9", &["\"9\"", "too many"]),
    (6, "c -1 2 0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &["b = 2", "0 to 1"]),
    (6, "c -2 0 0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &["a = -2"]),
    (6, "c -1 -1 0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &["two fixed"]),
    (6, "c 1 1 0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &["body 1 with itself"]),
    (6, "c -1 0 -0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &["friction -0.5"]),
    (6, "c -1 0 0.5 0 0 0 0 0 2 1 0 0 0 1 0 0 0 0 0 0 -1", &["normal [0.0, 0.0, 2.0]", "length 1"]),
    (6, "c -1 0 0.5 0 0 0 0 0 1 inf 0 0 0 1 0 0 0 0 0 0 -1", &["first tangent inf"]),
    (6, "c -1 0 0.5 0 0 0 0 0 1 1 0 0 0 1 0 0 0 0 0 0 -1", &[]),
];

#[test]
fn a_bad_line_is_refused_in_one_line_that_names_it_and_the_value() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bad.contacts");
    let good = tower(&[1.0, 1.0]).to_text();
    for &(line, text, named) in REFUSED {
        let mut lines: Vec<_> = good.lines().collect();
        lines[line - 1] = text;
        std::fs::write(&path, lines.join("\n")).expect("written");
        let read = ContactProblem::read(&path);
        // The last is a good one: the others could not fail if it were refused.
        let Err(error) = read else { return assert!(named.is_empty(), "{text} is taken") };
        let error = error.to_string();
        assert!(!named.is_empty() && error.contains("bad.contacts: line ") && error.lines().count() == 1, "{error}");
        let counts_differ = line == 3 && (error.contains("where \"") || error.contains("after"));
        assert!(counts_differ || error.contains(&format!("line {line}: ")), "{error}");
        for part in named {
            assert!(error.contains(part), "{text}: {part} is not in: {error}");
        }
    }
}

#[test]
fn a_text_that_is_cut_off_anywhere_is_refused() {
    let good = tower(&[1.0]).to_text();
    let lines: Vec<_> = good.lines().collect();
    for kept in 0..lines.len() {
        let error = ContactProblem::parse(&lines[..kept].join("\n")).expect_err("cut off").to_string();
        assert!(error.starts_with(&format!("line {}: ends where", kept + 1)), "{kept} lines: {error}");
    }
    ContactProblem::parse(&format!("{good}\n \n")).expect("blank lines at the end are nothing");
}
