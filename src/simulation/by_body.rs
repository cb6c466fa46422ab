//! Which contacts each body has.

/// The rows of the contacts of each body.
#[derive(Clone, Debug, Default)]
pub(super) struct ByBody {
    /// Where the rows of each body begin, and where those of the last end.
    begins: Vec<u32>,
    rows: Vec<u32>,
}

impl ByBody {
    /// Lists the contacts of `bodies` bodies: the rows, each with two bodies.
    pub fn list(&mut self, bodies: usize, contacts: impl Iterator<Item = (usize, [u32; 2])> + Clone) {
        self.begins.clear();
        self.begins.resize(bodies + 2, 0);
        for (_, pair) in contacts.clone() {
            pair.iter().for_each(|&body| self.begins[body as usize + 2] += 1);
        }
        for i in 2..self.begins.len() {
            self.begins[i] += self.begins[i - 1];
        }
        self.rows.clear();
        self.rows.resize(self.begins.last().map_or(0, |&end| end as usize), 0);
        // The entry after that of a body is where its next row goes, and in the end where its rows end.
        for (row, pair) in contacts {
            for body in pair {
                let next = &mut self.begins[body as usize + 1];
                self.rows[*next as usize] = row as u32;
                *next += 1;
            }
        }
    }

    /// Forgets all.
    pub fn forget(&mut self) {
        self.begins.clear();
        self.rows.clear();
    }

    /// The rows of the contacts of a body; none if no lists were made.
    pub fn of(&self, body: usize) -> Option<&[u32]> {
        if self.begins.is_empty() {
            return None;
        }
        let ends = self.begins.get(body).zip(self.begins.get(body + 1));
        Some(ends.map_or(&[], |(&begin, &end)| &self.rows[begin as usize..end as usize]))
    }
}
