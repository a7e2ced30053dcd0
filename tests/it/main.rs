//! Integration tests, in one binary.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::panic,
    clippy::unwrap_used,
    reason = "tests check the program by other means, and may stop at the first failure"
)]

/// Makes two tests of each function: one with SQLite and one with PostgreSQL.
macro_rules! on_both {
    ($($name:ident),* $(,)?) => {
        mod sqlite {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                super::$name($crate::database::Engine::Sqlite).await;
            })*
        }

        mod postgres {
            $(#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                super::$name($crate::database::Engine::Postgres).await;
            })*
        }
    };
}

mod access;
mod api;
mod audit;
mod chunks;
mod command_line;
mod damage;
mod database;
mod derivatives;
mod documents;
mod encryption;
mod evaluate;
mod faults;
mod figures;
mod first_start;
mod forms;
mod full_disk;
mod groups;
mod hostile_files;
mod keeping;
mod keys;
mod kill;
mod killed_commands;
mod library;
mod listing;
mod many;
mod measurements;
mod metrics;
mod mistakes;
mod moving;
mod names;
mod nodes;
mod openapi;
mod parts;
mod plots;
mod program;
mod refusals;
mod reports;
mod restore;
mod room;
mod rooms;
mod rule;
mod schema;
mod server;
mod shared_names;
mod sign_in;
mod so_far;
mod store;
mod studies;
mod study_plots;
mod team;
mod trust;
mod umbridge;
mod upgrade;
mod verification;
mod verified_import;
mod worker;
