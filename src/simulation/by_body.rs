//! The contacts of each body.

/// The rows of the contacts of each body.
#[derive(Clone, Debug, Default)]
pub(super) struct ByBody {
    /// Where the rows of each body begin, and the end of the last one.
    begins: Vec<u32>,
    rows: Vec<u32>,
}

impl ByBody {
    /// Lists the contacts of `bodies` bodies. Each contact has a row and two bodies.
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
        // The entry after that of a body holds the place of its next row, and in the end the place where its rows end.
        for (row, pair) in contacts {
            for body in pair {
                let next = &mut self.begins[body as usize + 1];
                self.rows[*next as usize] = row as u32;
                *next += 1;
            }
        }
    }

    /// Discards the lists.
    pub fn forget(&mut self) {
        self.begins.clear();
        self.rows.clear();
    }

    /// The rows of the contacts of a body, or `None` if no lists exist.
    pub fn of(&self, body: usize) -> Option<&[u32]> {
        if self.begins.is_empty() {
            return None;
        }
        let ends = self.begins.get(body).zip(self.begins.get(body + 1));
        Some(ends.map_or(&[], |(&begin, &end)| &self.rows[begin as usize..end as usize]))
    }
}
