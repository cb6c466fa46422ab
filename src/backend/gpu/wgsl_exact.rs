//! Exact mode in WGSL, for adapters that do not accept SPIR-V: integers guard sums and products.
//!
//! WGSL allows a compiler to reassociate and to fuse operations. Here every sum, difference and product passes through
//! an exclusive or of its bits with an integer that the host sets to 0. No compiler knows that value, so each result is
//! rounded before its use. Selects between floats also go through integers, and comparisons have guarded sides: a
//! compiler could turn them into a minimum or maximum, which may return either signed zero. Zeros are guarded too: a compiler could replace the product of 0
//! and x by 0, and the sum of 0 and x by x, without regard to signs. Signs are guarded as well: otherwise the negation
//! of 0 could be 0.

use std::ops::Range;

use naga::proc::TypeResolution;
use naga::{BinaryOperator, Expression, Handle, ScalarKind, TypeInner, UnaryOperator};

use super::bindings::Binding;
use super::reflect::Reflected;

/// The guard functions, for one number and for vectors of two to four.
const GUARDED: [(&str, &str, &str); 4] =
    [("1", "f32", "u32"), ("2", "vec2f", "vec2u"), ("3", "vec3f", "vec3u"), ("4", "vec4f", "vec4u")];

/// The same program. Any compiler that respects integer arithmetic computes it as written.
pub fn exact_wgsl(reflected: &Reflected, source: &str) -> String {
    let mut edits = Edits(Vec::new());
    let module = &reflected.module;
    let functions = module.functions.iter().map(|(handle, function)| (function, &reflected.info[handle]));
    let entry = (&module.entry_points[0].function, reflected.info.get_entry_point(0));
    for (function, info) in functions.chain([entry]) {
        for (handle, expression) in function.expressions.iter() {
            let span = |handle: Handle<Expression>| function.expressions.get_span(handle).to_range();
            if let Expression::Binary { op, left, right } = *expression
                && let Some(sign) = comparison(op)
                && floats(&info[left].ty, module) == Some(1)
                && let Some(range) = span(handle)
            {
                let is_free = |side| {
                    !matches!(
                        function.expressions[side],
                        Expression::Literal(_)
                            | Expression::Binary {
                                op: BinaryOperator::Add | BinaryOperator::Subtract | BinaryOperator::Multiply,
                                ..
                            }
                    )
                };
                edits.compare(source, range, sign, [left, right].map(is_free));
                continue;
            }
            let Some(size) = floats(&info[handle].ty, module) else { continue };
            let Some(range) = span(handle) else { continue };
            match *expression {
                Expression::Binary {
                    op: op @ (BinaryOperator::Add | BinaryOperator::Subtract | BinaryOperator::Multiply),
                    ..
                } => edits.guard(source, range, op, size),
                Expression::Select { .. } => edits.choose(source, range, size),
                Expression::Unary { op: UnaryOperator::Negate, .. } => edits.negate(source, range, size),
                _ => {}
            }
        }
    }
    edits.guard_zeros(source);
    edits.apply(source) + &functions_of(zero(reflected))
}

/// The sign of a comparison; `None` for other operations.
fn comparison(op: BinaryOperator) -> Option<&'static str> {
    Some(match op {
        BinaryOperator::Equal => "==",
        BinaryOperator::NotEqual => "!=",
        BinaryOperator::Less => "<",
        BinaryOperator::LessEqual => "<=",
        BinaryOperator::Greater => ">",
        BinaryOperator::GreaterEqual => ">=",
        _ => return None,
    })
}

/// Number of floats in a value, or `None` for other types.
fn floats(ty: &TypeResolution, module: &naga::Module) -> Option<usize> {
    match *ty.inner_with(&module.types) {
        TypeInner::Scalar(scalar) if scalar.kind == ScalarKind::Float => Some(1),
        TypeInner::Vector { size, scalar } if scalar.kind == ScalarKind::Float => Some(size as usize),
        _ => None,
    }
}

/// The name of the program's number that the host sets to 0.
fn zero(reflected: &Reflected) -> &'static str {
    if reflected.bindings.contains(&Binding::Resident) { "resident.zero" } else { "params.zero" }
}

fn functions_of(zero: &str) -> String {
    let function = |(size, floats, integers): (&str, &str, &str)| {
        format!(
            "fn guarded_{size}(x: {floats}) -> {floats} {{ return bitcast<{floats}>(bitcast<{integers}>(x) ^ {integers}({zero})); }}
fn opposite_{size}(x: {floats}) -> {floats} {{ return bitcast<{floats}>(bitcast<{integers}>(x) ^ {integers}(0x80000000u)); }}
fn chosen_{size}(no: {floats}, yes: {floats}, is: bool) -> {floats} {{
    return bitcast<{floats}>(select(bitcast<{integers}>(no), bitcast<{integers}>(yes), is));
}}
"
        )
    };
    GUARDED.into_iter().map(function).collect()
}

/// Replacements of parts of a text.
struct Edits(Vec<Edit>);

struct Edit {
    at: usize,
    /// Number of bytes that the new text replaces.
    length: usize,
    new: String,
    /// The end of the expression. Of two expressions with the same start, the longer one is the outer one.
    end: usize,
}

impl Edits {
    fn add(&mut self, at: usize, length: usize, new: String, end: usize) {
        self.0.push(Edit { at, length, new, end });
    }

    /// Wraps an expression, without its first `cut` bytes, in a function call; `open` is the name of the function with
    /// its bracket.
    fn wrap(&mut self, Range { start, end }: Range<usize>, cut: usize, open: String) {
        self.add(start, cut, open, end);
        self.add(end, 0, ")".into(), end);
    }

    /// Wraps an operation, or an assignment with an operation, in the guard function.
    fn guard(&mut self, source: &str, Range { start, end }: Range<usize>, op: BinaryOperator, size: usize) {
        let text = &source[start..end];
        let sign = match op {
            BinaryOperator::Add => "+",
            BinaryOperator::Subtract => "-",
            _ => "*",
        };
        if let Some(at) = text.find(&format!("{sign}=")) {
            // a += b; becomes a = guarded(a + (b));
            let left = text[..at].trim_end();
            let end = start + text.trim_end().trim_end_matches(';').len();
            self.add(start + at, 2, format!("= guarded_{size}({left} {sign} ("), end);
            self.add(end, 0, "))".into(), end);
        } else {
            self.wrap(start..end, 0, format!("guarded_{size}("));
        }
    }

    /// Wraps zeros in functions in the guard functions, except zeros that a number is compared with.
    fn guard_zeros(&mut self, source: &str) {
        for (zero, size) in [("0.0", 1), ("vec2f()", 2), ("vec3f()", 3), ("vec4f()", 4)] {
            for (at, _) in source.match_indices(zero) {
                let (before, after) = (&source[..at], &source[at + zero.len()..]);
                let is_part = before.ends_with(|c: char| c.is_alphanumeric() || c == '.')
                    || after.starts_with(|c: char| c.is_ascii_digit() || c == 'e');
                let is_compared = before.trim_end().ends_with(['<', '>', '=']) && !before.trim_end().ends_with(" =");
                let line = before.rsplit('\n').next().expect("a line");
                if !(is_part || is_compared || line.starts_with("const ")) {
                    self.wrap(at..at + zero.len(), 0, format!("guarded_{size}("));
                }
            }
        }
    }

    fn negate(&mut self, source: &str, Range { start, end }: Range<usize>, size: usize) {
        debug_assert!(source[start..].starts_with('-'), "{}", &source[start..end]);
        self.wrap(start..end, 1, format!("opposite_{size}("));
    }

    /// Wraps those sides of a comparison in the guard function that are `free`.
    fn compare(&mut self, source: &str, Range { start, end }: Range<usize>, sign: &str, free: [bool; 2]) {
        let text = &source[start..end];
        let (left, _) = text.split_once(&format!(" {sign} ")).expect("spaces around a sign");
        let right = start + left.len() + sign.len() + 2;
        // These calls are outside of everything else that begins at the same place.
        let sides = [start..start + left.len(), right..end].into_iter().zip(free);
        for (side, _) in sides.filter(|(_, is_free)| *is_free) {
            self.add(side.start, 0, "guarded_1(".into(), end + 1);
            self.add(side.end, 0, ")".into(), side.end);
        }
    }

    fn choose(&mut self, source: &str, Range { start, end }: Range<usize>, size: usize) {
        debug_assert!(source[start..].starts_with("select("), "{}", &source[start..end]);
        self.add(start, "select".len(), format!("chosen_{size}"), end);
    }

    /// The text with all replacements.
    fn apply(mut self, source: &str) -> String {
        self.0.sort_by_key(|edit| (edit.at, std::cmp::Reverse(edit.end)));
        let (mut text, mut from) = (String::new(), 0);
        for Edit { at, length, new, .. } in self.0 {
            text += &source[from..at];
            text += &new;
            from = at + length;
        }
        text + &source[from..]
    }
}
