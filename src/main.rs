//! The program. All of its code is in the library, so that the compiler makes each part once.

use std::process::ExitCode;

use mimalloc::MiMalloc;

/// Requests and results are many short allocations, freed by other threads than those that made them.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    fretwork::cli::main()
}
