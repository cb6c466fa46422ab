//! Contact problems as text: see docs/contacts-format.md.

use std::fmt::Write;
use std::path::Path;
use std::str::{FromStr, Lines, SplitWhitespace};

use glam::{DMat3, DVec3};

use super::{ContactProblem, FreeBody, PointContact, Problem, Velocity, is_positive_definite};
use drystone::stages::error::{ensure, input};
use drystone::{Error, Result};

/// The first bytes of an HDF5 file.
const HDF5_SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Reads a file of text or HDF5.
fn read<T>(path: &Path, fclib: fn(Vec<u8>) -> Result<T>, text: fn(&str) -> Result<T>) -> Result<T> {
    let bytes = std::fs::read(path).map_err(Error::file(path))?;
    let problem = if bytes.starts_with(HDF5_SIGNATURE) {
        fclib(bytes)
    } else {
        String::from_utf8(bytes).map_err(|_| Error::input("neither text nor HDF5")).and_then(|bytes| text(&bytes))
    };
    problem.map_err(|e| e.within(path.display()))
}

impl Problem {
    /// Reads a file: text, or FCLIB's HDF5 in global or local form.
    ///
    /// # Errors
    /// The file cannot be read, or is not a contact problem. The message names the file, and the line or dataset with
    /// its value.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        read(path.as_ref(), Self::from_fclib, |text| ContactProblem::parse(text).map(Self::Bodies))
    }
}

impl ContactProblem {
    /// Reads a file: text, or FCLIB's HDF5.
    ///
    /// ```
    /// let missing = drystone_problems::ContactProblem::read("no such file").expect_err("there is none");
    /// assert!(missing.to_string().starts_with("no such file: "));
    /// ```
    ///
    /// # Errors
    /// The file cannot be read, or is not a contact problem. The message names the file, and the line or dataset with
    /// its value.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        read(path.as_ref(), Self::from_fclib, Self::parse)
    }

    /// Reads text.
    ///
    /// # Errors
    /// The text is not a contact problem. The message names the line and the value.
    pub fn parse(text: &str) -> Result<Self> {
        let mut reader = Reader { lines: text.lines(), line: 0 };
        let mut problem = Self::default();
        reader.row("contacts", |f| match f.take::<u32>("version")? {
            1 => Ok(()),
            version => Err(input!("version {version}: only version 1 is supported")),
        })?;
        problem.name = reader.next("the name")?.trim().to_owned();
        let (bodies, contacts) = reader.row("bodies", |f| {
            let bodies = f.take::<u32>("number of bodies")?;
            f.word("contacts")?;
            Ok((bodies, f.take::<u32>("number of contacts")?))
        })?;
        for _ in 0..bodies {
            problem.bodies.push(reader.row("b", body)?);
        }
        for _ in 0..contacts {
            problem.contacts.push(reader.row("c", |f| contact(f, bodies))?);
        }
        reader.end()?;
        Ok(problem)
    }

    /// Writes text. Reading it gives every number with the same bits.
    pub fn to_text(&self) -> String {
        let name = self.name.replace(char::is_control, " ");
        let name = name.trim();
        let (bodies, contacts) = (self.bodies.len(), self.contacts.len());
        let mut text = format!("contacts 1\n{name}\nbodies {bodies} contacts {contacts}\n");
        let mut row = |head: String, numbers: &[f64]| {
            text.push_str(&head);
            for x in numbers {
                // The shortest text from which the same bits are read.
                write!(text, " {x:?}").expect("a string takes everything");
            }
            text.push('\n');
        };
        for FreeBody { mass, inertia: i, free } in &self.bodies {
            let inertia = [i.x_axis.x, i.y_axis.x, i.z_axis.x, i.y_axis.y, i.z_axis.y, i.z_axis.z];
            row("b".into(), &[&[*mass], &inertia[..], &free.linear.to_array(), &free.angular.to_array()].concat());
        }
        for c in &self.contacts {
            let index = |body: Option<u32>| body.map_or(-1, i64::from);
            let vectors = [c.offset, c.frame[0], c.frame[1], c.frame[2], c.r_a, c.r_b].map(|x| x.to_array());
            row(format!("c {} {}", index(c.a), index(c.b)), &[&[c.friction], vectors.as_flattened()].concat());
        }
        text
    }
}

fn body(f: &mut Fields) -> Result<FreeBody> {
    let mass = f.number("mass")?;
    ensure(mass > 0.0, || format!("mass {mass:?}: must be more than 0"))?;
    let entries @ [xx, xy, xz, yy, yz, zz] = f.numbers("inertia")?;
    let inertia = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    ensure(is_positive_definite(inertia), || format!("inertia {entries:?}: must be positive definite"))?;
    let free = Velocity { linear: f.vector("velocity")?, angular: f.vector("angular velocity")? };
    Ok(FreeBody { mass, inertia, free })
}

fn contact(f: &mut Fields, bodies: u32) -> Result<PointContact> {
    let [a, b] = [f.body("a", bodies)?, f.body("b", bodies)?];
    if a == b {
        let which = a.map_or("two fixed bodies".into(), |i| format!("body {i} with itself"));
        return Err(input!("a contact of {which}"));
    }
    let friction = f.number("friction")?;
    ensure(friction >= 0.0, || format!("friction {friction:?}: must not be negative"))?;
    let offset = f.vector("offset")?;
    let frame = [f.vector("normal")?, f.vector("first tangent")?, f.vector("second tangent")?];
    let message = || format!("normal {:?}: must have length 1", frame[0].to_array());
    ensure((frame[0].length() - 1.0).abs() <= 1e-6, message)?;
    Ok(PointContact { a, b, friction, offset, frame, r_a: f.vector("arm of a")?, r_b: f.vector("arm of b")? })
}

/// The lines of a text, with their numbers.
struct Reader<'a> {
    lines: Lines<'a>,
    line: usize,
}

impl<'a> Reader<'a> {
    fn next(&mut self, expected: &str) -> Result<&'a str> {
        self.line += 1;
        let end = || input!("line {}: ends where {expected} should be", self.line);
        self.lines.next().ok_or_else(end)
    }

    /// A line that begins with `head`. `take` has to read all its fields.
    fn row<T>(&mut self, head: &str, take: impl FnOnce(&mut Fields) -> Result<T>) -> Result<T> {
        let mut fields = Fields { words: self.next(&format!("{head:?}"))?.split_whitespace() };
        let taken = fields.word(head).and_then(|()| take(&mut fields)).and_then(|row| match fields.words.next() {
            Some(word) => Err(input!("{} is one field too many", quoted(word))),
            None => Ok(row),
        });
        taken.map_err(|e| e.within(format!("line {}", self.line)))
    }

    /// Only blank lines may follow.
    fn end(mut self) -> Result<()> {
        match self.lines.by_ref().inspect(|_| self.line += 1).find(|line| !line.trim().is_empty()) {
            Some(line) => Err(input!("line {}: {} after the last contact", self.line, quoted(line))),
            None => Ok(()),
        }
    }
}

/// Largest number of characters of a file that a message quotes.
const MAX_QUOTED: usize = 80;

/// The text in quotes, or only its beginning: a file can have any content.
fn quoted(text: &str) -> String {
    match text.char_indices().nth(MAX_QUOTED) {
        Some((end, _)) => format!("{:?}...", &text[..end]),
        None => format!("{text:?}"),
    }
}

/// The fields of one line.
struct Fields<'a> {
    words: SplitWhitespace<'a>,
}

impl Fields<'_> {
    fn word(&mut self, expected: &str) -> Result<()> {
        match self.words.next() {
            Some(word) if word == expected => Ok(()),
            Some(word) => Err(input!("{} where {expected:?} should be", quoted(word))),
            None => Err(input!("ends where {expected:?} should be")),
        }
    }

    fn take<T: FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.words.next().ok_or_else(|| input!("ends where {what} should be"))?;
        word.parse().map_err(|_| input!("{what} {}: cannot be read", quoted(word)))
    }

    fn number(&mut self, what: &str) -> Result<f64> {
        let x: f64 = self.take(what)?;
        ensure(x.is_finite(), || format!("{what} {x:?}: must be finite"))?;
        Ok(x)
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for x in &mut numbers {
            *x = self.number(what)?;
        }
        Ok(numbers)
    }

    fn vector(&mut self, what: &str) -> Result<DVec3> {
        self.numbers(what).map(DVec3::from_array)
    }

    /// Index of a body, or `None` for -1.
    fn body(&mut self, what: &str, bodies: u32) -> Result<Option<u32>> {
        match self.take::<i64>(what)? {
            -1 => Ok(None),
            i if (0..i64::from(bodies)).contains(&i) => Ok(Some(i as u32)),
            i => Err(input!("body {what} = {i}: must be -1 or one of 0 to {}", i64::from(bodies) - 1)),
        }
    }
}
