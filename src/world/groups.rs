//! Which bodies meet which.

/// The groups that a body is a member of, and those that it meets: 32 of each, one bit a group.
///
/// Two bodies meet where each is a member of a group that the other meets.
///
/// ```
/// use drystone::Groups;
///
/// let (walls, ghosts) = (Groups::ALL, Groups { membership: 0b10, filter: 0b10 });
/// assert!(walls.meets(walls) && ghosts.meets(ghosts));
/// assert!(Groups { membership: 0b01, filter: u32::MAX }.meets(walls));
/// assert!(!Groups { membership: 0b01, filter: u32::MAX }.meets(ghosts));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize, serde::Serialize, schemars::JsonSchema),
    serde(deny_unknown_fields, default)
)]
pub struct Groups {
    /// The groups that it is a member of.
    pub membership: u32,
    /// The groups that it meets.
    pub filter: u32,
}

crate::saved::fields!(Groups { membership, filter });

impl Groups {
    /// A member of all groups that meets all: what a body has unless told otherwise.
    pub const ALL: Self = Self { membership: u32::MAX, filter: u32::MAX };

    /// Whether two of these meet.
    pub fn meets(self, other: Self) -> bool {
        self.membership & other.filter != 0 && other.membership & self.filter != 0
    }
}

impl Default for Groups {
    fn default() -> Self {
        Self::ALL
    }
}
