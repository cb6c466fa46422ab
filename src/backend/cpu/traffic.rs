//! Bytes that the lanes hold and move, for comparison with memory limits.

use super::Cpu;
use super::bodies::State;
use crate::config::FrictionRule;
use crate::lanes::{Row8, WIDTH};
use crate::plan::Kernel;

impl Cpu {
    /// Bytes that a sweep of `kernel` over all contacts of the last run reads and writes: it reads groups and points,
    /// reads and writes impulses, and for each lane reads two bodies and writes their velocities. Empty lanes count
    /// too.
    pub fn bytes_of_sweep(&self, kernel: Kernel) -> usize {
        let start = if kernel.reads_start() { size_of::<Row8>() } else { 0 };
        let body = size_of::<State>() + size_of::<Row8>() + start;
        let has_friction = kernel.rules().is_some_and(|rules| rules.friction != FrictionRule::None);
        let rows = self.contact_points.bytes(has_friction) + 2 * self.contact_impulses.bytes(has_friction);
        self.bytes_of_groups() + rows + self.contacts.groups.len() * 2 * WIDTH * body
    }

    /// Bytes of all data that sweeps read or write, each counted once.
    pub fn bytes_of_contacts(&self) -> usize {
        let rows = self.contact_points.bytes(true) + self.contact_impulses.bytes(true);
        self.bytes_of_groups() + rows + size_of_val(&self.bodies[..])
    }

    fn bytes_of_groups(&self) -> usize {
        size_of_val(&self.contacts.groups[..])
    }
}
