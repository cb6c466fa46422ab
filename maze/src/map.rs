//! Boards as text.

use std::path::Path;

use drystone::stages::suggest::hint;
use drystone::{Error, Result};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    Floor,
    Wall,
    /// A round hole, wider than the ball.
    Hole,
}

/// A board: rows of cells, start and goal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Map {
    pub name: String,
    /// Rows from the far side to the near side.
    pub rows: usize,
    /// Cells in a row, from left to right.
    pub columns: usize,
    cells: Vec<Cell>,
    /// Rows and columns of start and goal.
    pub start: (usize, usize),
    pub goal: (usize, usize),
}

pub const BOARDS: [(&str, &str); 3] = [
    ("easy", include_str!("../boards/easy.txt")),
    ("medium", include_str!("../boards/medium.txt")),
    ("hard", include_str!("../boards/hard.txt")),
];

/// Largest number of rows and columns.
const MOST: usize = 64;

impl Map {
    pub fn find(name_or_path: &str) -> Result<Self> {
        if let Some((name, text)) = BOARDS.iter().find(|b| b.0 == name_or_path) {
            return Self::parse(name, text);
        }
        let path = Path::new(name_or_path);
        if path.extension().is_none() && !path.exists() {
            let known = BOARDS.map(|b| b.0);
            let hint = hint(name_or_path, known, format_args!("known boards: {}", known.join(", ")));
            return Err(Error::input(format!("{name_or_path:?} is neither a board nor a file{hint}")));
        }
        let text = std::fs::read_to_string(path).map_err(Error::file(path))?;
        Self::parse(name_or_path, &text)
    }

    /// Reads a map: `.` floor, `#` wall, `O` hole, `S` start, `G` goal. A line is a row, and all rows have the same
    /// length. Empty lines and lines that begin with `;` are ignored.
    pub fn parse(name: &str, text: &str) -> Result<Self> {
        let refuse = |line: usize, column: usize, what: String| {
            Err(Error::input(format!("{name}: line {line}, column {column}: {what}")))
        };
        let (mut cells, mut rows, mut columns) = (Vec::new(), 0, 0);
        let (mut start, mut goal) = (None, None);
        let mut last_line = 1;
        for (line, row) in (1..).zip(text.lines()) {
            let row = row.trim_end();
            if row.is_empty() || row.starts_with(';') {
                continue;
            }
            last_line = line;
            if rows == MOST {
                return refuse(line, 1, format!("more than {MOST} rows"));
            }
            let mut count = 0;
            for (column, symbol) in row.chars().enumerate() {
                let place = Some((rows, column));
                let (cell, special) = match symbol {
                    '.' => (Cell::Floor, None),
                    '#' => (Cell::Wall, None),
                    'O' => (Cell::Hole, None),
                    'S' => (Cell::Floor, Some((&mut start, "start"))),
                    'G' => (Cell::Floor, Some((&mut goal, "goal"))),
                    _ => return refuse(line, column + 1, format!("{symbol:?}: must be one of . # O S G")),
                };
                if let Some((found, what)) = special {
                    if found.is_some() {
                        return refuse(line, column + 1, format!("a second {what}"));
                    }
                    *found = place;
                }
                cells.push(cell);
                count = column + 1;
            }
            columns = if rows == 0 { count } else { columns };
            if columns > MOST {
                return refuse(line, MOST + 1, format!("more than {MOST} columns"));
            }
            if count != columns {
                let what = format!("{count} cells; the first row has {columns}");
                return refuse(line, count.min(columns) + 1, what);
            }
            rows += 1;
        }
        let missing =
            |what: &str| Error::input(format!("{name}: line {last_line}, column 1: the map ends without {what}"));
        let start = start.ok_or_else(|| missing("a start, S"))?;
        let goal = goal.ok_or_else(|| missing("a goal, G"))?;
        Ok(Self { name: name.into(), rows, columns, cells, start, goal })
    }

    /// The cell at a place. All cells beyond the map are walls.
    pub fn at(&self, row: isize, column: isize) -> Cell {
        let inside = |x: isize, end: usize| usize::try_from(x).ok().filter(|&x| x < end);
        match (inside(row, self.rows), inside(column, self.columns)) {
            (Some(row), Some(column)) => self.cells[row * self.columns + column],
            _ => Cell::Wall,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        Map::parse("m", text).expect_err("a bad map").to_string()
    }

    #[test]
    fn the_boards_of_the_crate_have_increasing_numbers_of_holes() {
        let holes = BOARDS.map(|(name, text)| {
            let map = Map::parse(name, text).expect(name);
            map.cells.iter().filter(|c| **c == Cell::Hole).count()
        });
        assert!(holes.is_sorted() && holes[0] > 0, "{holes:?}");
    }

    #[test]
    fn a_bad_map_is_refused_with_line_and_column() {
        assert_eq!(refusal("S.\n.xG\n"), "m: line 2, column 2: 'x': must be one of . # O S G");
        assert_eq!(refusal("; a comment\nS.G\n..\n"), "m: line 3, column 3: 2 cells; the first row has 3");
        assert_eq!(refusal("S.\n..G\n"), "m: line 2, column 3: 3 cells; the first row has 2");
        assert_eq!(refusal("S.S\n..G\n"), "m: line 1, column 3: a second start");
        assert_eq!(refusal("...\n..G\n"), "m: line 2, column 1: the map ends without a start, S");
        assert_eq!(refusal(""), "m: line 1, column 1: the map ends without a start, S");
        assert_eq!(refusal("S"), "m: line 1, column 1: the map ends without a goal, G");
        assert_eq!(refusal(&".".repeat(65)), "m: line 1, column 65: more than 64 columns");
        assert_eq!(refusal(&".\n".repeat(65)), "m: line 65, column 1: more than 64 rows");
    }

    #[test]
    fn beyond_the_map_is_wall() {
        let map = Map::parse("m", "SG\n.O\n").expect("a map");
        assert_eq!((map.start, map.goal, map.at(1, 1)), ((0, 0), (0, 1), Cell::Hole));
        assert_eq!((map.at(-1, 0), map.at(0, 2)), (Cell::Wall, Cell::Wall));
    }
}
