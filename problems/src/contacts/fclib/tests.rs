//! Files in the form that other programs write, and invalid files.

use hdf5_pure::{FileBuilder, GroupBuilder};

use super::*;
use crate::contacts::Operator;

#[derive(Clone, Debug)]
pub(super) enum Data {
    Whole(Vec<i32>),
    Real(Vec<f64>),
}

/// The datasets of a file, by path within the global problem; `M/x` before another group begins.
pub(super) type Tree = Vec<(&'static str, Data)>;

/// Three boxes, one on the ground and two on top of it. One of the upper boxes has only one contact. The tangents are
/// not orthogonal.
pub(super) fn boxes() -> ContactProblem {
    let free = Velocity { linear: DVec3::new(0.1, -0.2, -1.0), angular: DVec3::new(0.3, -0.7, 0.2) };
    let body = |mass: f64| {
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), mass);
        let inertia = turn * DMat3::from_diagonal(DVec3::new(0.1, 0.2, 0.15) * mass) * turn.transpose();
        FreeBody { mass, inertia, free }
    };
    let contact = |a: Option<u32>, b: Option<u32>, r_a: [f64; 3], r_b: [f64; 3]| PointContact {
        a,
        b,
        friction: 0.3,
        offset: DVec3::new(0.01, 0.02, 0.03),
        frame: [DVec3::Z, DVec3::new(0.8, 0.0, 0.6), DVec3::Y],
        r_a: r_a.into(),
        r_b: r_b.into(),
    };
    let ground = [[-0.5, -0.4], [-0.5, 0.5], [0.6, -0.5]].map(|[x, y]| contact(None, Some(0), [0.0; 3], [x, y, -0.5]));
    let upper = [
        contact(Some(0), Some(1), [-0.3, 0.1, 0.5], [0.2, 0.3, -0.4]),
        contact(Some(0), Some(1), [0.4, 0.2, 0.5], [0.9, 0.4, -0.4]),
        contact(Some(2), Some(0), [0.1, 0.2, 0.7], [-0.5, 0.0, -0.1]),
        // Fixed on the side that the normal points to.
        contact(Some(1), None, [0.1, -0.1, 0.4], [0.0; 3]),
    ];
    ContactProblem {
        name: "boxes".into(),
        bodies: [1.0, 2.0, 0.5].map(body).to_vec(),
        contacts: [&ground[..], &upper].concat(),
    }
}

/// A file of the problem, with the axes of body i turned by i + 1 rad.
fn tree(problem: &ContactProblem) -> Tree {
    let turn = |body: usize| DMat3::from_axis_angle(DVec3::new(0.36, 0.48, 0.8), 1.0 + body as f64);
    let (mut m, mut h) = (Sparse::default(), Sparse::default());
    let mut f = Vec::new();
    for (i, body) in problem.bodies.iter().enumerate() {
        let own = turn(i).transpose() * body.inertia * turn(i);
        for k in 0..3 {
            m.push(6 * i + k, 6 * i + k, body.mass);
            (0..3).for_each(|l| m.push(6 * i + 3 + l, 6 * i + 3 + k, own.col(k)[l]));
        }
        f.extend((body.mass * body.free.linear).to_array());
        f.extend((own * (turn(i).transpose() * body.free.angular)).to_array());
    }
    for (i, c) in problem.contacts.iter().enumerate() {
        for k in 0..3 {
            for (body, arm, d) in [(c.a, c.r_a, -c.frame[k]), (c.b, c.r_b, c.frame[k])] {
                let Some(body) = body.map(|b| b as usize) else { continue };
                let own = turn(body).transpose() * arm.cross(d);
                (0..3).for_each(|row| h.push(6 * body + row, 3 * i + k, d[row]));
                (0..3).for_each(|row| h.push(6 * body + 3 + row, 3 * i + k, own[row]));
            }
        }
    }
    let size = 6 * problem.bodies.len() as i32;
    let mut tree = vec![("spacedim", Data::Whole(vec![3]))];
    tree.extend(triplets(["M/nzmax", "M/m", "M/n", "M/nz", "M/p", "M/i", "M/x"], &m, [size, size]));
    let columns = 3 * problem.contacts.len() as i32;
    tree.extend(triplets(["H/nzmax", "H/m", "H/n", "H/nz", "H/p", "H/i", "H/x"], &h, [size, columns]));
    tree.push(("vectors/f", Data::Real(f)));
    tree.push(("vectors/w", Data::Real(problem.contacts.iter().flat_map(|c| c.offset.to_array()).collect())));
    tree.push(("vectors/mu", Data::Real(problem.contacts.iter().map(|c| c.friction).collect())));
    tree
}

pub(super) fn triplets(names: [&'static str; 7], matrix: &Sparse, [rows, columns]: [i32; 2]) -> Tree {
    let e = &matrix.entries;
    let count = e.len() as i32;
    let sizes = [count, rows, columns, count].map(|size| Data::Whole(vec![size]));
    let [p, i] = [e.iter().map(|e| e.1 as i32).collect(), e.iter().map(|e| e.0 as i32).collect()].map(Data::Whole);
    names.into_iter().zip(sizes.into_iter().chain([p, i, Data::Real(e.iter().map(|e| e.2).collect())])).collect()
}

pub(super) fn bytes(tree: &Tree, group: &str) -> Vec<u8> {
    let put = |group: &mut GroupBuilder, name: &str, data: &Data| {
        match data {
            Data::Whole(numbers) => group.create_dataset(name).with_i32_data(numbers),
            Data::Real(numbers) => group.create_dataset(name).with_f64_data(numbers),
        };
    };
    let mut file = FileBuilder::new();
    let mut global = file.create_group(group);
    for inner in ["M", "H", "G", "W", "R", "vectors"] {
        let mut within = global.create_group(inner);
        let mut any = false;
        for (path, data) in tree {
            match path.split_once('/') {
                Some((group, name)) if group == inner => put(&mut within, name, data),
                _ => continue,
            }
            any = true;
        }
        if any {
            global.add_group(within.finish());
        }
    }
    tree.iter().filter(|(path, _)| !path.contains('/')).for_each(|(path, data)| put(&mut global, path, data));
    file.add_group(global.finish());
    file.finish().expect("a file")
}

pub(super) fn change<'a>(tree: &'a mut Tree, path: &str) -> &'a mut Data {
    &mut tree.iter_mut().find(|(at, _)| *at == path).expect(path).1
}

/// Largest difference between the contact velocities of two problems, without impulses and under each unit impulse.
fn difference(one: &ContactProblem, other: &ContactProblem) -> f64 {
    let mut worst: f64 = 0.0;
    let (one_op, other_op) = (Operator::new(one), Operator::new(other));
    let count = one.contacts.len();
    for pushed in 0..=3 * count {
        let mut impulses = vec![DVec3::ZERO; count];
        if pushed < 3 * count {
            impulses[pushed / 3][pushed % 3] = 1.0;
        }
        let [u, v] = [&one_op, &other_op].map(|op| {
            let velocities = op.velocities(&impulses);
            (0..count).map(|i| op.relative_velocity(i, &velocities)).collect::<Vec<_>>()
        });
        u.iter().zip(&v).for_each(|(u, v)| worst = worst.max(u.distance(*v)));
    }
    worst
}

#[test]
fn angular_parts_in_body_axes_give_the_same_problem() {
    let problem = boxes();
    let read = ContactProblem::from_fclib(bytes(&tree(&problem), "fclib_global")).expect("read");
    let worst = difference(&problem, &read);
    assert!(worst < 1e-13, "{worst} m/s");
    for (c, r) in problem.contacts.iter().zip(&read.contacts) {
        assert_eq!((c.a, c.b, c.friction, c.offset, c.frame), (r.a, r.b, r.friction, r.offset, r.frame));
        // The third body has only one contact, so any arm that points out of it fits.
        if c.a != Some(2) {
            assert!(c.r_a.distance(r.r_a) < 1e-13 && c.r_b.distance(r.r_b) < 1e-13, "{c:?} {r:?}");
        }
    }
    let mut other = problem.clone();
    other.bodies[1].inertia *= 1.0 + 1e-6;
    assert!(difference(&other, &read) > 1e-8, "another inertia is seen");
}

/// Bodies with one contact each, on the side that the normal points to and on the other side. Either sign of an arm
/// fits.
#[test]
fn arms_that_fit_either_way_point_out_of_their_bodies() {
    let mut problem = boxes();
    let first = problem.contacts[0];
    let contact = |a, b, r_a: DVec3, r_b: DVec3| PointContact { a, b, r_a, r_b, ..first };
    let (below, above) = (DVec3::new(0.2, 0.3, -0.4), DVec3::new(-0.1, 0.2, 0.7));
    problem.contacts = vec![contact(None, Some(0), DVec3::ZERO, below), contact(Some(1), Some(2), above, below)];
    let read = ContactProblem::from_fclib(bytes(&tree(&problem), "fclib_global")).expect("read");
    for (c, r) in problem.contacts.iter().zip(&read.contacts) {
        // The length is that of the file, and the arms point along the normal on a and against it on b.
        for (was, is, out) in [(c.a.map(|_| c.r_a), r.r_a, 1.0), (c.b.map(|_| c.r_b), r.r_b, -1.0)] {
            let Some(was) = was else { continue };
            assert!((is.length() - was.length()).abs() < 1e-13 && out * is.dot(r.frame[0]) > 0.0, "{was} became {is}");
        }
    }
    let worst = difference(&problem, &read);
    assert!(worst < 1e-13, "{worst} m/s");
}

#[test]
fn what_is_written_is_read_back() {
    let problem = boxes();
    let read = ContactProblem::from_fclib(problem.to_fclib().expect("written")).expect("read");
    let worst = difference(&problem, &read);
    assert!(worst < 1e-13 && read.name == problem.name, "{worst} m/s");
    let nameless = ContactProblem { name: String::new(), ..problem };
    assert_eq!(ContactProblem::from_fclib(nameless.to_fclib().expect("written")).expect("read").name, "");
}

/// The entries of a matrix in a file, sorted by column and row, with the start of each column or row.
fn compressed(tree: &Tree, by_row: bool) -> [Data; 3] {
    let numbers = |path: &str| match tree.iter().find(|(at, _)| *at == path) {
        Some((_, Data::Whole(x))) => x.clone(),
        _ => panic!("{path}"),
    };
    let Some((_, Data::Real(x))) = tree.iter().find(|(at, _)| *at == "H/x") else { panic!("H/x") };
    let (p, i) = (numbers("H/p"), numbers("H/i"));
    let (outer, inner) = if by_row { (i, p) } else { (p, i) };
    let mut entries: Vec<_> = outer.into_iter().zip(inner).zip(x.clone()).collect();
    entries.sort_by_key(|e| e.0);
    let count = numbers(if by_row { "H/m" } else { "H/n" })[0];
    let begin = |k: i32| entries.iter().filter(|e| e.0.0 < k).count() as i32;
    [
        Data::Whole((0..=count).map(begin).collect()),
        Data::Whole(entries.iter().map(|e| e.0.1).collect()),
        Data::Real(entries.iter().map(|e| e.1).collect()),
    ]
}

#[test]
fn the_three_forms_of_a_matrix_are_one_and_repeated_entries_are_summed() {
    let problem = boxes();
    for (form, by_row) in [(-1, false), (-2, true)] {
        let mut tree = tree(&problem);
        let [p, i, x] = compressed(&tree, by_row);
        for (path, data) in [("H/nz", Data::Whole(vec![form])), ("H/p", p), ("H/i", i), ("H/x", x)] {
            *change(&mut tree, path) = data;
        }
        let read = ContactProblem::from_fclib(bytes(&tree, "fclib_global")).expect("read");
        assert!(difference(&problem, &read) < 1e-13, "form {form}");
    }
    let mut tree = tree(&problem);
    for (path, more) in [("M/p", 0), ("M/i", 0), ("M/nz", 0), ("M/nzmax", 0)] {
        let Data::Whole(numbers) = change(&mut tree, path) else { panic!("{path}") };
        if path.starts_with("M/nz") { numbers[0] += 1 } else { numbers.push(more) }
    }
    let Data::Real(numbers) = change(&mut tree, "M/x") else { panic!("M/x") };
    numbers[0] -= 0.25;
    numbers.push(0.25);
    let read = ContactProblem::from_fclib(bytes(&tree, "fclib_global")).expect("read");
    assert!(difference(&problem, &read) < 1e-13, "repeated");
}

#[test]
fn an_unsymmetric_inertia_is_data() {
    let problem = boxes();
    let mut tree = tree(&problem);
    let [Data::Whole(p), Data::Whole(i)] = ["M/p", "M/i"].map(|path| change(&mut tree, path).clone()) else { panic!() };
    let place = p.iter().zip(&i).position(|(&p, &i)| (p, i) == (3, 4)).expect("an entry beside the diagonal");
    let Data::Real(x) = change(&mut tree, "M/x") else { panic!("M/x") };
    x[place] *= 1.001;
    let read = ContactProblem::from_fclib(bytes(&tree, "fclib_global")).expect("read");
    let inertia = read.bodies[0].inertia;
    assert!((inertia.x_axis.y - inertia.y_axis.x).abs() < 1e-16);
    assert!((1e-9..1e-3).contains(&difference(&problem, &read)));
}

/// A change of a file, and the text that the error must contain.
#[test]
fn a_bad_file_is_refused_in_one_line_that_names_the_dataset() {
    use Data::{Real, Whole};
    let good = tree(&boxes());
    let number = |path: &str, k: usize, x: f64| {
        let Some((_, Real(numbers))) = good.iter().find(|(at, _)| *at == path) else { panic!("{path}") };
        let mut numbers = numbers.clone();
        numbers[k] = x;
        Real(numbers)
    };
    let index = |path: &str, k: usize, x: i32| {
        let Some((_, Whole(numbers))) = good.iter().find(|(at, _)| *at == path) else { panic!("{path}") };
        let mut numbers = numbers.clone();
        numbers[k] = x;
        Whole(numbers)
    };
    for (path, data, named) in [
        ("spacedim", Whole(vec![2]), "must be 3"),
        ("M/m", Whole(vec![24]), "24 x 18"),
        ("M/m", Whole(vec![-18]), "-18: must be 0 or more"),
        ("M/nz", Whole(vec![-3]), "-3: must be -2, -1 or a count"),
        ("M/nz", Whole(vec![5]), "5 numbers are needed"),
        ("M/nz", Whole(vec![1, 2]), "1 numbers are needed"),
        ("M/i", index("M/i", 2, 18), "18: must be 0 or more and less than 18"),
        ("M/i", index("M/i", 2, -1), "-1: must be"),
        ("M/i", index("M/i", 0, 7), "(7, 0) couples two bodies"),
        ("M/x", number("M/x", 0, 1.1), "body 0: its rows are not one mass"),
        ("M/x", number("M/x", 1, -9.0), "body 0: mass"),
        ("M/x", Real(vec![1.0; 3]), "[3]"),
        ("M/x", number("M/x", 4, f64::NAN), "number 4 is NaN"),
        ("H/m", Whole(vec![24]), "24 x 21"),
        ("H/n", Whole(vec![2_000_000_001]), "a contact is empty"),
        ("H/x", number("H/x", 0, 7.5), "angular rows do not follow from lever arms"),
        ("H/p", index("H/p", 0, 20), "contact"),
        ("vectors/f", Real(vec![0.0; 17]), "[17], but 18 numbers"),
        ("vectors/w", Real(vec![0.0; 22]), "[22], but 21 numbers"),
        ("vectors/w", number("vectors/w", 3, f64::INFINITY), "number 3 is inf"),
        ("vectors/mu", number("vectors/mu", 6, -0.5), "-0.5 of contact 6"),
    ] {
        let mut tree = good.clone();
        *change(&mut tree, path) = data;
        let error = ContactProblem::from_fclib(bytes(&tree, "fclib_global")).expect_err(named).to_string();
        let group = format!("fclib_global/{}", path.split('/').next().expect("a group"));
        assert!(error.starts_with(&group) && error.contains(named) && error.lines().count() == 1, "{path}: {error}");
    }
    for missing in good.iter().map(|(path, _)| *path) {
        // Room for additional entries, which the first form does not use.
        if missing.ends_with("nzmax") {
            continue;
        }
        let tree = good.iter().filter(|(path, _)| *path != missing).cloned().collect();
        let error = ContactProblem::from_fclib(bytes(&tree, "fclib_global")).expect_err(missing).to_string();
        assert!(error.starts_with(&format!("fclib_global/{missing}: ")) && error.lines().count() == 1, "{error}");
    }
    let mut jointed = good.clone();
    jointed.push(("G/m", Whole(vec![18])));
    let refused = |bytes: Vec<u8>| ContactProblem::from_fclib(bytes).expect_err("refused").to_string();
    assert_eq!(refused(bytes(&jointed, "fclib_global")), "fclib_global/G: joints cannot be read");
    assert_eq!(refused(bytes(&good, "fclib_global_rolling")), "fclib_global_rolling: rolling friction cannot be read");
    assert!(refused(bytes(&good, "fclib_local")).starts_with("fclib_local/W/m: "));
    assert_eq!(refused(bytes(&good, "other")), "no group fclib_global or fclib_local: not an FCLIB file");
}

#[test]
fn a_file_that_is_cut_off_anywhere_is_refused_in_one_line() {
    let whole = boxes().to_fclib().expect("written");
    for kept in (8..whole.len()).step_by(7) {
        let error = ContactProblem::from_fclib(whole[..kept].to_vec()).expect_err("cut off").to_string();
        assert_eq!(error.lines().count(), 1, "{kept} bytes: {error}");
    }
}

#[test]
fn a_file_with_a_wrong_byte_anywhere_is_read_or_refused_in_one_line() {
    let whole = boxes().to_fclib().expect("written");
    let mut refused = 0;
    for place in (8..whole.len()).step_by(5) {
        for byte in [0, 0x7f, 0xff] {
            let mut wrong = whole.clone();
            wrong[place] = byte;
            if let Err(error) = ContactProblem::from_fclib(wrong) {
                assert_eq!(error.to_string().lines().count(), 1, "byte {place}: {error}");
                refused += 1;
            }
        }
    }
    assert!(refused > 0);
}
