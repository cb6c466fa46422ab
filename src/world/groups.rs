//! Collision groups: which bodies collide with which.

/// The groups that a body belongs to, and the groups that it collides with: 32 bits each, one bit for each group.
///
/// Two bodies collide if each one belongs to a group that the other collides with.
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
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize), serde(deny_unknown_fields, default))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Groups {
    /// The groups that the body belongs to.
    pub membership: u32,
    /// The groups that the body collides with.
    pub filter: u32,
}

crate::saved::fields!(Groups { membership, filter });

impl Groups {
    /// Belongs to all groups and collides with all groups. This is the default.
    pub const ALL: Self = Self { membership: u32::MAX, filter: u32::MAX };

    /// Whether two bodies with these groups collide.
    pub fn meets(self, other: Self) -> bool {
        self.membership & other.filter != 0 && other.membership & self.filter != 0
    }
}

impl Default for Groups {
    fn default() -> Self {
        Self::ALL
    }
}
