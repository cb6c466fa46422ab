//! Numbers and sparse matrices of an FCLIB file.

use hdf5_pure::{Dataset, File, FileBuilder, GroupBuilder, LibVer};

use drystone::stages::error::{ensure, input};
use drystone::{Error, Result};

/// An open file. Every error names the dataset.
pub(super) struct Tables {
    file: File,
}

impl Tables {
    pub(super) fn open(bytes: Vec<u8>) -> Result<Self> {
        let length = bytes.len() as u64;
        let file = File::from_bytes(bytes).map_err(|e| input!("not a whole HDF5 file: {e}"))?;
        // Without this check, a missing end would go unnoticed if it holds only optional data.
        let whole = file.superblock().eof_address;
        ensure(length >= whole, || format!("not a whole HDF5 file: {length} of {whole} bytes"))?;
        Ok(Self { file })
    }

    /// Whether a group of that name exists.
    pub(super) fn has(&self, group: &str) -> bool {
        self.file.group(group).is_ok()
    }

    /// Text on one line; empty if there is none.
    pub(super) fn text(&self, path: &str) -> String {
        let words = self.file.dataset(path).and_then(|d| d.read_string()).unwrap_or_default();
        words.join(" ").replace(char::is_control, " ").trim().to_owned()
    }

    /// One whole number.
    pub(super) fn number(&self, path: &str) -> Result<i64> {
        Ok(self.whole(path, 1)?[0])
    }

    /// Reads `count` whole numbers.
    fn whole(&self, path: &str, count: usize) -> Result<Vec<i64>> {
        self.read(path, count, |d| d.read_i64())
    }

    /// Reads `count` numbers, all finite.
    pub(super) fn reals(&self, path: &str, count: usize) -> Result<Vec<f64>> {
        let numbers = self.read(path, count, |d| d.read_f64())?;
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(i) => Err(input!("{path}: number {i} is {:?}: must be finite", numbers[i])),
            None => Ok(numbers),
        }
    }

    /// Reads `count` friction coefficients.
    pub(super) fn frictions(&self, path: &str, count: usize) -> Result<Vec<f64>> {
        let mu = self.reals(path, count)?;
        match mu.iter().position(|&mu| mu < 0.0) {
            Some(i) => Err(Error::input(format!("{path}: {:?} of contact {i}: must not be negative", mu[i]))),
            None => Ok(mu),
        }
    }

    fn read<T>(
        &self,
        path: &str,
        count: usize,
        read: impl FnOnce(&Dataset) -> std::result::Result<Vec<T>, hdf5_pure::Error>,
    ) -> Result<Vec<T>> {
        let wrong = |e: hdf5_pure::Error| input!("{path}: {e}");
        let dataset = self.file.dataset(path).map_err(wrong)?;
        let shape = dataset.shape().map_err(wrong)?;
        // Check before reading: a wrong size must not allocate memory.
        let found = shape.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
        let message = || format!("{path}: has the shape {shape:?}, but {count} numbers are needed");
        ensure(found == Some(count as u64), message)?;
        let numbers = read(&dataset).map_err(wrong)?;
        ensure(numbers.len() == count, || format!("{path}: holds {} of {count} numbers", numbers.len()))?;
        Ok(numbers)
    }

    /// A sparse matrix in one of three forms. If `nz` is a count, row `i` and column `p` give the place of each entry.
    /// With -1 the entries are sorted by columns, and with -2 by rows, each from `p[k]` to `p[k + 1]`.
    pub(super) fn matrix(&self, group: &str) -> Result<Sparse> {
        let path = |name: &str| format!("{group}/{name}");
        let size = |name: &str| {
            let number = self.number(&path(name))?;
            usize::try_from(number).map_err(|_| input!("{}: {number}: must be 0 or more", path(name)))
        };
        let (rows, columns) = (size("m")?, size("n")?);
        let form = self.number(&path("nz"))?;
        let (count, pointers) = match form {
            -1 => (size("nzmax")?, Some(columns)),
            -2 => (size("nzmax")?, Some(rows)),
            nz => (usize::try_from(nz).map_err(|_| input!("{}: {nz}: must be -2, -1 or a count", path("nz")))?, None),
        };
        let outer = self.whole(&path("p"), pointers.map_or(count, |n| n.saturating_add(1)))?;
        let inner = self.whole(&path("i"), count)?;
        let outer = match pointers {
            None => outer,
            Some(_) => unfold(&outer, count)
                .ok_or_else(|| input!("{}: must rise from 0 to the number of entries, {count}", path("p")))?,
        };
        let values = self.reals(&path("x"), count)?;
        let place = |name: &str, index: i64, least: usize| match usize::try_from(index) {
            Ok(i) if i < least => Ok(i),
            _ => Err(input!("{}: {index}: must be 0 or more and less than {least}", path(name))),
        };
        let entries = inner.into_iter().zip(outer).zip(values).map(|((inner, outer), x)| match form {
            -2 => Ok((place("p", outer, rows)?, place("i", inner, columns)?, x)),
            _ => Ok((place("i", inner, rows)?, place("p", outer, columns)?, x)),
        });
        Ok(Sparse { rows, columns, entries: entries.collect::<Result<_>>()? })
    }
}

/// The row or column of each entry, from the start of each row or column. If `nzmax` is larger than the number of
/// entries, the rest is unused.
fn unfold(pointers: &[i64], count: usize) -> Option<Vec<i64>> {
    let rises = pointers.first() == Some(&0) && pointers.is_sorted() && pointers.last() == Some(&(count as i64));
    let run = |(k, range): (usize, &[i64])| std::iter::repeat_n(k as i64, (range[1] - range[0]) as usize);
    rises.then(|| pointers.windows(2).enumerate().flat_map(run).collect())
}

/// A sparse matrix: row, column, value. A place that occurs twice holds the sum.
#[derive(Clone, Debug, Default)]
pub(super) struct Sparse {
    pub rows: usize,
    pub columns: usize,
    pub entries: Vec<(usize, usize, f64)>,
}

impl Sparse {
    /// Adds a value unless it is zero.
    pub(super) fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.entries.push((row, column, value));
        }
    }

    /// Writes entries by row and column. No other form is readable for all readers of the global problem.
    fn write(&self, group: &mut GroupBuilder, name: &str) -> Result<()> {
        let mut matrix = group.create_group(name);
        let index = |i: usize| i32::try_from(i).map_err(|_| input!("{i} does not fit an FCLIB file"));
        let indices = |of: fn(&(usize, usize, f64)) -> usize| self.entries.iter().map(|e| index(of(e))).collect();
        let (i, p): (Result<Vec<i32>>, Result<Vec<i32>>) = (indices(|e| e.0), indices(|e| e.1));
        let x: Vec<f64> = self.entries.iter().map(|e| e.2).collect();
        let count = self.entries.len();
        for (name, size) in [("nzmax", count), ("m", self.rows), ("n", self.columns), ("nz", count)] {
            matrix.create_dataset(name).with_i32_data(&[index(size)?]);
        }
        matrix.create_dataset("p").with_i32_data(&p?);
        matrix.create_dataset("i").with_i32_data(&i?);
        matrix.create_dataset("x").with_f64_data(&x);
        group.add_group(matrix.finish());
        Ok(())
    }
}

/// A global problem as a file: M v = H r + f, u = Hᵀ v + w.
pub(super) struct Global<'a> {
    pub title: &'a str,
    pub m: Sparse,
    pub h: Sparse,
    pub f: Vec<f64>,
    pub w: Vec<f64>,
    pub mu: Vec<f64>,
}

impl Global<'_> {
    /// Uses the layout of HDF5 1.8, which every reader supports.
    pub(super) fn to_bytes(&self) -> Result<Vec<u8>> {
        let mut file = FileBuilder::new();
        file.with_libver_bounds(LibVer::Earliest, LibVer::V18);
        let mut global = file.create_group("fclib_global");
        global.create_dataset("spacedim").with_i32_data(&[3]);
        self.m.write(&mut global, "M")?;
        self.h.write(&mut global, "H")?;
        let mut vectors = global.create_group("vectors");
        for (name, numbers) in [("f", &self.f), ("w", &self.w), ("mu", &self.mu)] {
            vectors.create_dataset(name).with_f64_data(numbers);
        }
        global.add_group(vectors.finish());
        let mut info = global.create_group("info");
        let description = concat!("contacts of rigid bodies, written by drystone ", env!("CARGO_PKG_VERSION"));
        for (name, text) in [("title", self.title), ("description", description)] {
            let text: String = text.chars().map(|c| if c.is_ascii() && !c.is_control() { c } else { '?' }).collect();
            // One more byte for the zero at the end of a C string.
            let width = text.len() as u32 + 1;
            let dataset = info.create_dataset(name).with_ascii_strings_sized(&[&text], width).map_err(Error::input)?;
            dataset.with_shape(&[]);
        }
        global.add_group(info.finish());
        file.add_group(global.finish());
        file.finish().map_err(Error::input)
    }
}
