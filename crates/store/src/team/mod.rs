//! Who may do what, and who did it: access keys, sessions of browsers, and the audit log.

pub(crate) mod audit;
pub(crate) mod keys;
pub(crate) mod sessions;
