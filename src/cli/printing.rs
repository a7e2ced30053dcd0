//! How commands print to standard output, and errors to standard error.

use std::io::{self, Write as _};

/// The error of a command. Its message is one line for the user.
pub type Error = Box<dyn std::error::Error>;

/// Prints an error and its causes to standard error, on one line.
pub fn print_error(error: &dyn std::error::Error) {
    let mut line = format!("fretwork: {error}");
    let mut source = error.source();
    while let Some(cause) = source {
        line = format!("{line}: {cause}");
        source = cause.source();
    }
    // If standard error is closed, the exit code still reports the failure.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes to standard output. A reader that closes the pipe early, such as `head`, is not an error.
pub fn print(text: &[u8]) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
