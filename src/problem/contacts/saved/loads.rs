//! The loads of slots, in columns.

use super::super::super::StepScale;
use super::super::super::rows::{ContactRow, ImpulseRow, MassRow};
use super::super::super::slots::Slot;
use crate::collide::{Detector, MAX_POINTS};
use crate::config::SolverConfig;
use crate::effort::Effort;
use crate::error::Result;
use crate::saved::Columns;

/// How much of the rows of a slot is saved.
#[derive(Clone, Copy, Default, PartialEq, PartialOrd)]
pub(super) enum Rows {
    #[default]
    /// Nothing. They follow from the rest.
    Remade,
    /// Only effective masses.
    Masses,
    /// All fields.
    All,
}

const BITS: usize = 0;
const LOADED: usize = 1;
const NORMAL: usize = 2;
const TANGENT: usize = 3;
const SAG: usize = 5;
const NEED: usize = 6;
const PRELOAD: usize = 7;
const SHARE: usize = 8;
const MASS: usize = 9;
const JAMS: usize = 11;
pub(super) const COLUMNS: usize = 12;

/// Preloads of contacts without a load.
const PRELOADS: [f32; 2] = [0.0, -0.0];

/// The load of a slot, and the fields of its rows that do not follow from its manifold.
#[derive(Clone, Copy, Default)]
pub(super) struct SlotLoads {
    pub rows: Rows,
    /// One for each point, and one for the patch.
    pub impulses: [ImpulseRow; MAX_POINTS + 1],
    pub sag: f32,
    pub need: f32,
    pub preload: f32,
    pub share: f32,
    /// Effective masses along the normal and along the tangents, in the same order.
    pub masses: [[f32; 2]; MAX_POINTS + 1],
    pub jams: bool,
}

/// The sources of the guesses in [`SlotLoads::walk`].
pub(super) struct Sources<'a> {
    pub detector: &'a Detector,
    pub effort: &'a Effort,
    pub config: &'a SolverConfig,
    pub scale: Option<&'a StepScale>,
    pub masses: &'a [MassRow],
}

impl SlotLoads {
    /// Writes or reads the load of a slot with `count` rows of points, including the patch. The caller already knows
    /// whether `rows` is [`Rows::All`].
    pub fn walk(
        &mut self,
        slot: &Slot,
        contact: &ContactRow,
        count: usize,
        sources: &Sources,
        columns: &mut Columns,
    ) -> Result<()> {
        let Sources { detector, effort, config, scale, masses } = *sources;
        let inv_mass = |body: u32| masses.get(body as usize).map_or(0.0, |mass| mass.inv_mass);
        let pair = detector.pair(slot.world, slot.pair);
        let usual_share = effort.share(if inv_mass(pair.body_a) > 0.0 { pair.body_a } else { pair.body_b } as usize);
        let has = [self.sag.to_bits() != 0, self.need.to_bits() != 0, self.share != usual_share];
        let preload = PRELOADS.iter().position(|usual| usual.to_bits() == self.preload.to_bits()).unwrap_or(2);
        let all = [self.rows == Rows::Masses, has[0], has[1], has[2]];
        let mut bits = (0..).zip(all).map(|(k, bit)| u8::from(bit) << k).sum::<u8>() | (preload as u8) << 4;
        columns.byte(BITS, &mut bits)?;
        let [has_masses, has_sag, has_need, has_share] = [0, 1, 2, 3].map(|k| bits >> k & 1 == 1);
        if columns.reads() {
            self.share = usual_share;
            if has_masses && self.rows == Rows::Remade {
                self.rows = Rows::Masses;
            }
        }
        if has_masses {
            for own in &mut self.masses[..count] {
                columns.float(MASS, &mut own[0])?;
                columns.float(MASS + 1, &mut own[1])?;
            }
            let mut jams = u8::from(self.jams);
            columns.byte(JAMS, &mut jams)?;
            self.jams = jams != 0;
        }
        walk_impulses(&mut self.impulses[..count], columns)?;
        match PRELOADS.get(usize::from(bits >> 4)) {
            Some(usual) => self.preload = *usual,
            None => columns.float(PRELOAD, &mut self.preload)?,
        }
        if has_share {
            columns.float(SHARE, &mut self.share)?;
        }
        let share = self.share;
        if has_sag {
            let pressed = self.impulses[..contact.point_count as usize].iter().map(|impulse| impulse.normal).sum();
            let [a, b] = [contact.body_a, contact.body_b].map(inv_mass);
            let yields = scale.map_or(0.0, |scale| scale.yielding(a > 0.0 && b > 0.0, pressed));
            columns.near(SAG, &mut self.sag, yields * share * (a + b))?;
        }
        if has_need {
            columns.near(NEED, &mut self.need, self.sag / (share * share * config.promised_sag(slot.size)))?;
        }
        Ok(())
    }
}

/// Writes or reads impulses. Zero impulses take less than a byte, and keep the signs of their friction. Peaks are not
/// saved, because they end with the step.
fn walk_impulses(impulses: &mut [ImpulseRow], columns: &mut Columns) -> Result<()> {
    const IS_LOADED: u8 = 4;
    let signed = |bit: u8| if bit == 0 { 0.0_f32 } else { -0.0 };
    let empty = |kind: u8| ImpulseRow {
        tangent_1: signed(kind & 1),
        tangent_2: signed(kind >> 1 & 1),
        ..ImpulseRow::default()
    };
    let bits_of = |impulse: &ImpulseRow| [impulse.normal, impulse.tangent_1, impulse.tangent_2].map(f32::to_bits);
    for impulse in impulses {
        let is_empty = |kind: &u8| bits_of(&empty(*kind)) == bits_of(impulse);
        let mut kind = (0..IS_LOADED).find(is_empty).unwrap_or(IS_LOADED);
        columns.byte(LOADED, &mut kind)?;
        if columns.reads() {
            *impulse = empty(kind & 3);
        }
        if kind == IS_LOADED {
            columns.float(NORMAL, &mut impulse.normal)?;
            columns.float(TANGENT, &mut impulse.tangent_1)?;
            columns.float(TANGENT + 1, &mut impulse.tangent_2)?;
        }
    }
    Ok(())
}
