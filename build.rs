//! Rebuilds the program when a migration changes, because migrations are embedded at compile time.

fn main() {
    println!("cargo:rerun-if-changed=migrations");
}
