//! Bytes that the lanes hold and move, to compare sweeps with the limits of memory.

use super::Cpu;
use super::bodies::State;
use super::lane_group::LaneGroup;
use crate::lanes::{Row8, WIDTH, Wide};
use crate::plan::Kernel;

impl Cpu {
    /// Bytes that a sweep of `kernel` over all contacts of the last run reads and writes: groups and points read, impulses read and
    /// written, and for each lane two bodies read and their velocities written. Lanes without a contact count.
    pub fn bytes_of_sweep(&self, kernel: Kernel) -> usize {
        let start = if kernel.reads_start() { size_of::<Row8>() } else { 0 };
        let body = size_of::<State>() + size_of::<Row8>() + start;
        let impulses = size_of_val(&self.contact_impulses[..]);
        self.bytes_of_groups() + 2 * impulses + self.contacts.groups.len() * 2 * WIDTH * body
    }

    /// Bytes of all that such a sweep reads or writes, each counted once.
    pub fn bytes_of_contacts(&self) -> usize {
        self.bytes_of_groups() + size_of_val(&self.contact_impulses[..]) + size_of_val(&self.bodies[..])
    }

    fn bytes_of_groups(&self) -> usize {
        self.contacts.groups.len() * size_of::<LaneGroup>() + self.contacts.points.len() * size_of::<[Wide; 12]>()
    }
}
