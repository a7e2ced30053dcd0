//! The disk space for pinned results.

use super::keep::Changed;

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

    /// The answer if the pinned results of an owner, or of all owners, take too many bytes.
    pub(super) fn exceeded_by(&self, own: u64, all: u64) -> Option<Changed> {
        let limits = [(own, Some(self.owner), false), (all, self.all, true)];
        limits.into_iter().find_map(|(used, quota, of_all)| {
            let quota = quota.filter(|quota| used > *quota)?;
            Some(Changed::QuotaExceeded { used, quota, of_all })
        })
    }
}
