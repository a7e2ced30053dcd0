//! The commands for access keys.

use std::time::Duration;

use clap::{Args, Subcommand};

use super::data::Data;
use crate::http::{self, KEY_LIFETIMES, KEY_NAMES, KEY_ROLES};
use fretwork_store::Role;

/// A command for access keys.
#[derive(Debug, Subcommand)]
pub enum Keys {
    /// Add a key and print it. It cannot be printed again.
    Add(AddKey),
    /// List the keys, without their secrets.
    List(Data),
    /// Share with all users the names that an owner gave before a version with shared names, or give its names to another owner.
    ShareNames {
        /// The owner: the name of a key, or the address of a client before there were keys.
        owner: String,
        /// Give the finished jobs and the notes to this owner, and share nothing.
        #[arg(long, value_parser = key_name)]
        give_to: Option<String>,
        #[command(flatten)]
        data: Data,
    },
    /// Revoke keys by id or by name. Their signed links become invalid too.
    Revoke {
        /// The id of one key, or the name of one or more keys.
        name: String,
        #[command(flatten)]
        data: Data,
    },
}

/// A new key.
#[derive(Debug, Args)]
pub struct AddKey {
    /// The owner of the key: letters, digits and . _ @ + -. Keys with the same name own the same jobs.
    #[arg(value_parser = key_name)]
    pub name: String,
    /// What the key allows: `read` reads results, `submit` also submits jobs, `admin` allows everything.
    #[arg(long, value_parser = role, value_name = "read|submit|admin")]
    pub role: Role,
    /// Time until it expires, such as 90d [default: never].
    #[arg(long, value_name = "TIME", value_parser = lifetime)]
    pub expires: Option<Duration>,
    /// Requests per minute; 0 means no limit [default: the server's --rate-limit].
    #[arg(long, value_name = "N")]
    pub rate: Option<u32>,
    /// Keep labels, tags and notes private: only the owner sees them, and administrators see the jobs.
    #[arg(long)]
    pub private: bool,
    #[command(flatten)]
    pub data: Data,
}

pub(super) fn role(text: &str) -> Result<Role, String> {
    text.parse().map_err(|_| format!("expected {KEY_ROLES}"))
}

/// Parses the name of a key.
fn key_name(text: &str) -> Result<String, String> {
    let name = http::is_owner_name(text).then(|| text.to_owned());
    name.ok_or_else(|| format!("expected {KEY_NAMES}"))
}

/// Parses the time until a key expires.
fn lifetime(text: &str) -> Result<Duration, String> {
    http::key_lifetime(text).ok_or_else(|| format!("expected {KEY_LIFETIMES}"))
}
