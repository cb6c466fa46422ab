//! In guarded WGSL no result of an operation on floats reaches another one, and none is chosen, unless through integers.

use std::collections::BTreeSet;

use naga::{BinaryOperator, Expression, Handle, Literal, ScalarKind, TypeInner};

use super::{every_program, every_text};
use drystone::stages::backend::shader::{Program, Reflected, Target, exact_wgsl};

fn guarded(source: &str) -> String {
    exact_wgsl(&Reflected::new("test", source).unwrap_or_else(|e| panic!("{e}")), source)
}

/// Operations that a compiler may change: sums and products of floats that something else than integers takes, zeros in them, choices between
/// floats, and everything that makes floats in another way than by reading and moving.
fn free(source: &str) -> BTreeSet<String> {
    let Reflected { module, info, .. } = Reflected::new("test", source).unwrap_or_else(|e| panic!("{e}\n{source}"));
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    let mut found = BTreeSet::new();
    for (function, info) in functions.chain([(&module.entry_points[0].function, info.get_entry_point(0))]) {
        // How often integers take an expression. Only arguments of the functions that steer are taken there.
        let name = function.name.clone().unwrap_or_default();
        let is_float = |handle: Handle<Expression>| match *info[handle].ty.inner_with(&module.types) {
            TypeInner::Scalar(scalar) | TypeInner::Vector { scalar, .. } => scalar.kind == ScalarKind::Float,
            TypeInner::Matrix { .. } => true,
            _ => false,
        };
        let (mut arguments, mut compared) = (BTreeSet::new(), BTreeSet::new());
        calls(&function.body, &mut |callee, values| {
            if module.functions[callee].name.as_ref().is_some_and(|name| name.starts_with("guarded_")) {
                arguments.extend(values.iter().copied());
            }
        });
        for (_, expression) in function.expressions.iter() {
            if let Expression::Binary { op, left, right } = expression {
                use BinaryOperator::{Equal, Greater, GreaterEqual, Less, LessEqual, NotEqual};
                if [Equal, NotEqual, Less, LessEqual, Greater, GreaterEqual].contains(op) {
                    compared.extend([*left, *right]);
                }
            }
        }
        for (handle, expression) in function.expressions.iter() {
            let what = match expression {
                Expression::Binary {
                    op: BinaryOperator::Add | BinaryOperator::Subtract | BinaryOperator::Multiply,
                    ..
                } if arguments.contains(&handle) && info[handle].ref_count == 1 => {
                    continue;
                }
                Expression::Binary { op, .. } => format!("{op:?}"),
                Expression::Select { .. } => "Select".into(),
                Expression::Unary { .. } => "Sign".into(),
                Expression::Math { fun, .. } => format!("{fun:?}"),
                Expression::As { convert: Some(_), .. } => "a conversion".into(),
                // A matrix is written before it is read.
                Expression::ZeroValue(_)
                    if matches!(info[handle].ty.inner_with(&module.types), TypeInner::Matrix { .. }) =>
                {
                    continue;
                }
                Expression::ZeroValue(_) | Expression::Literal(Literal::F32(0.0))
                    if !arguments.contains(&handle) && !compared.contains(&handle) =>
                {
                    "Zero".into()
                }
                _ => continue,
            };
            if is_float(handle) {
                found.insert(format!("{what} in {name}"));
            }
        }
    }
    found
}

/// Takes a function that is called, and its arguments.
type EachCall<'a> = &'a mut dyn FnMut(Handle<naga::Function>, &[Handle<Expression>]);

/// The calls of a block and of those inside.
fn calls(block: &naga::Block, each: EachCall) {
    for statement in block.iter() {
        match statement {
            naga::Statement::Call { function, arguments, .. } => each(*function, arguments),
            naga::Statement::Block(inner) => calls(inner, each),
            naga::Statement::If { accept, reject, .. } => [accept, reject].into_iter().for_each(|b| calls(b, each)),
            naga::Statement::Switch { cases, .. } => cases.iter().for_each(|case| calls(&case.body, each)),
            naga::Statement::Loop { body, continuing, .. } => {
                [body, continuing].into_iter().for_each(|b| calls(b, each));
            }
            _ => {}
        }
    }
}

#[test]
fn integers_steer_every_sum_product_and_choice() {
    for (program, target) in every_text() {
        assert_eq!(free(&guarded(&program.source(target))), BTreeSet::new(), "{program:?}, {target:?}");
    }
    // Plain WGSL has hundreds.
    assert!(!free(&every_program()[0].source(Target::Software)).is_empty());
}

/// A program that computes as `text` says with `x: array<f32>` and `v: vec3f`.
fn program(text: &str) -> String {
    format!(
        "struct Params {{ zero: u32 }}
        @group(0) @binding(0) var<uniform> params: Params;
        @group(0) @binding(2) var<storage, read_write> x: array<f32>;
        @compute @workgroup_size(64) fn main() {{ var v = vec3f(x[0], x[1], x[2]); var s = x[3]; {text} x[4] = s + v.x; }}"
    )
}

#[test]
fn what_a_compiler_may_change_is_found_and_guarded() {
    for (text, guarded_text) in [
        ("s = s * x[1] + x[2];", "s = guarded_1(guarded_1(s * x[1]) + x[2]);"),
        ("s += x[1] * (s - 1.0);", "s = guarded_1(s + (guarded_1( x[1] * (guarded_1(s - 1.0)))));"),
        ("v -= v * s;", "v = guarded_3(v - (guarded_3( v * s)));"),
        ("v = s * s * v;", "v = guarded_3(guarded_1(s * s) * v);"),
        ("s = s * x[1] + 0.0;", "s = guarded_1(guarded_1(s * x[1]) + guarded_1(0.0));"),
        ("v = vec3f(1.0, 0.0, s) - vec3f();", "v = guarded_3(vec3f(1.0, guarded_1(0.0), s) - guarded_3(vec3f()));"),
        ("if s > 0.0 { s = 0.05 - 10.0 * s; }", "if guarded_1(s) > 0.0 { s = guarded_1(0.05 - guarded_1(10.0 * s)); }"),
        ("s = -(s * x[1]);", "s = opposite_1((guarded_1(s * x[1])));"),
        ("v = -v * s - v;", "v = guarded_3(guarded_3(opposite_3(v) * s) - v);"),
        ("s = select(s, x[1], s > x[1]);", "s = chosen_1(s, x[1], guarded_1(s) > guarded_1(x[1]));"),
        ("s = select(s * 2.0, s, s * s > 1.0);", "s = chosen_1(guarded_1(s * 2.0), s, guarded_1(s * s) > 1.0);"),
    ] {
        let plain = program(text);
        assert!(!free(&plain).is_empty(), "{text}");
        let changed = guarded(&plain);
        let squeezed = |text: &str| text.replace(' ', "");
        assert!(squeezed(&changed).contains(&squeezed(guarded_text)), "{text}: {changed}");
        assert_eq!(free(&changed), BTreeSet::new(), "{text}");
    }
    for (text, found) in [("s = sqrt(s);", "Sqrt"), ("s = max(s, x[1]);", "Max"), ("s = s / x[1];", "Divide")] {
        let left = free(&guarded(&program(text)));
        assert!(left.iter().any(|free| free.starts_with(found)), "{text}: {left:?}");
    }
}

#[test]
fn the_number_that_steers_is_one_of_the_program() {
    for program in [Program::RESIDENT[1].clone(), every_program()[0].clone()] {
        let text = guarded(&program.source(Target::Software));
        let of_begin = Program::RESIDENT.contains(&program);
        assert_eq!(text.contains("resident.zero"), of_begin, "{program:?}");
        assert_eq!(text.contains("params.zero"), !of_begin, "{program:?}");
    }
}
