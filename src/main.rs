//! The program. The library contains all other code, so that it is compiled once.

use std::process::ExitCode;

use mimalloc::MiMalloc;

/// The program makes many short-lived allocations, and other threads free them. mimalloc is fast at this. On Linux,
/// SQLite and Zstandard use this allocator, too. It does not ask for huge pages, because they increase the memory of a
/// server by a third. Version 3 keeps freed memory for a second, version 2 for a tenth of that: two large studies need a third
/// less.
#[global_allocator]
static ALLOCATOR: MiMalloc = MiMalloc;

fn main() -> ExitCode {
    fretwork::cli::main()
}
