//! The disk space for pinned results.

/// How many bytes of results may be pinned.
#[derive(Debug, Clone, Copy)]
pub(super) struct PinQuota {
    /// By one owner.
    pub(super) owner: u64,
    /// By all owners together; `None` without a limit.
    pub(super) all: Option<u64>,
}

impl PinQuota {
    /// The quota of one owner, and half of the budget for all owners together.
    pub(super) fn new(owner: u64, budget: Option<u64>) -> Self {
        let all = budget.map(|budget| budget / 2);
        Self { owner: all.map_or(owner, |all| owner.min(all)), all }
    }
}
