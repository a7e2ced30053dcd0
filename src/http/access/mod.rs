//! Access control: identifies the caller of a request, and checks its role and its limits.
//!
//! A server without keys accepts every caller, and therefore listens on this machine only. As soon as the
//! server has a key, every caller must send a key.

pub mod caller;
pub mod gate;
pub mod keyring;
pub mod limits;
pub mod needs;
pub mod secret;
pub mod session;
pub mod sign_on;
pub mod signed_link;

pub use caller::{Identity, LINK_HOLDER};
pub use gate::{Access, Gate, check};
