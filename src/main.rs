//! The program. The library contains all other code, so that it is compiled once.

use std::process::ExitCode;

use mimalloc::MiMalloc;

/// Requests and results are many short allocations, freed by other threads than those that made them.
/// On Linux, SQLite and Zstandard use this allocator, too. It asks for no huge pages: they make a server a third larger.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    fretwork::cli::main()
}
