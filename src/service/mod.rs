//! Everything the program can do with jobs and results; HTTP and the command line are faces of it.

pub mod workers;
