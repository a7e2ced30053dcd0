//! The commands of the program.

pub mod administration;
pub mod moving;

use std::io::{self, Write as _};

/// What ends a command: its message is one line for the user.
pub type Failure = Box<dyn std::error::Error>;

/// Prints an error and its causes on one line.
pub fn complain(failure: &dyn std::error::Error) {
    let mut line = format!("fretwork: {failure}");
    let mut cause = failure.source();
    while let Some(error) = cause {
        line = format!("{line}: {error}");
        cause = error.source();
    }
    // With standard error closed there is nobody to tell.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes to standard output. A reader that has seen enough, such as `head`, is not an error.
pub fn say(text: &[u8]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
