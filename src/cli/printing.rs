//! How commands print to standard output, and errors to standard error.

use std::io::{self, IsTerminal as _, Write as _};
use std::iter;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::Value;

use fretwork_engine::Fault;
use fretwork_format::{in_engineering, round};

/// The error of a command. Its message is one line for the user.
pub type Error = Box<dyn std::error::Error>;

/// The end of a command with an exit code of its own.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}", .lines.join("\n"))]
pub struct Ended {
    /// The exit code: 2 if an input has faults, for instance.
    pub code: u8,
    /// What the user must know, such as a line for each fault.
    pub lines: Vec<String>,
}

impl Ended {
    /// Ends a command by the faults of a file. They name the file unless it is standard input.
    pub fn by_faults(faults: &[Fault], file: &Path) -> Self {
        let name = file.display().to_string();
        let line = |Fault { pointer, detail }: &Fault| {
            let place = [&name, pointer].into_iter().filter(|it| !["", "-"].contains(&it.as_str()));
            place.chain([detail]).map(String::as_str).collect::<Vec<_>>().join(": ")
        };
        Self { code: 2, lines: faults.iter().map(line).collect() }
    }

    /// The end of a command by an error: its own, or one line with another error and its causes.
    pub fn of(error: &Error) -> Self {
        let causes = iter::successors(Some(&**error), |&error| error.source());
        let causes: Vec<_> = causes.map(ToString::to_string).collect();
        let other = || Self { code: 1, lines: vec![format!("fretwork: {}", causes.join(": "))] };
        error.downcast_ref().cloned().unwrap_or_else(other)
    }

    /// Prints the lines to standard error. Returns the exit code.
    pub fn print(&self) -> u8 {
        // If standard error is closed, the exit code still reports the error.
        for line in &self.lines {
            say(&harmless(line));
        }
        self.code
    }

    /// The end of a command that has said all.
    pub fn with(code: u8) -> Result<(), Error> {
        if code == 0 { Ok(()) } else { Err(Self { code, lines: Vec::new() }.into()) }
    }
}

/// Writes to standard output. A reader that closes the pipe early, such as `head`, is not an error.
pub fn print(text: &[u8]) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// A text of a server or a file, in which a terminal obeys nothing: control characters are shown as text.
pub fn harmless(text: &str) -> String {
    let shown = |it: char| match it {
        // These change the order of the letters.
        '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => it.escape_default().to_string(),
        _ if it.is_control() => it.escape_default().to_string(),
        _ => it.to_string(),
    };
    text.chars().map(shown).collect()
}

/// Characters in the bar of the progress.
const WIDTH: usize = 40;
/// Time before the first bar, so that short computations show none.
const QUIET: Duration = Duration::from_secs(1);
/// Minimum time between two bars.
const INTERVAL: Duration = Duration::from_millis(200);

/// The progress of a computation, as a bar on standard error if that is a terminal. The bar vanishes when this is dropped.
pub struct Progress {
    pub is_terminal: bool,
    is_shown: bool,
    next: Instant,
}

impl Progress {
    /// A progress, which is shown only if it is wanted.
    pub fn new(is_wanted: bool) -> Self {
        let is_terminal = is_wanted && io::stderr().is_terminal();
        Self { is_terminal, is_shown: false, next: Instant::now() + QUIET }
    }

    /// Shows the part that is done, from 0 to 1. An error is ignored, because progress is optional.
    pub fn show(&mut self, done: f64) {
        if self.is_terminal && Instant::now() > self.next {
            (self.is_shown, self.next) = (true, Instant::now() + INTERVAL);
            let _ = write!(io::stderr(), "\r{}", bar(done));
        }
    }
}

/// A bar. A server may answer any number.
fn bar(done: f64) -> String {
    let done = done.clamp(0.0, 1.0);
    let full = "#".repeat((done * WIDTH as f64) as usize);
    format!("[{full:<WIDTH$}] {:3.0} %", 100.0 * done)
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.is_shown {
            let _ = write!(io::stderr(), "\r{:<1$}\r", "", WIDTH + 8);
        }
    }
}

/// Says something while a command works, over the bar of the progress. An error is ignored, as that of the bar is.
pub fn say(line: &str) {
    let (start, width) = if io::stderr().is_terminal() { ("\r", WIDTH + 8) } else { ("", 0) };
    let _ = writeln!(io::stderr(), "{start}{line:<width$}");
}

/// A number of things.
pub fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// A number in SI with four digits, in its engineering unit.
pub fn shown(number: &Value, unit: &str) -> String {
    let Some(number) = number.as_f64() else { return "-".to_owned() };
    let (number, unit) = in_engineering(number, unit);
    let (number, unit) = (round(number, 4), if unit == "1" { "" } else { unit });
    let is_plain = number == 0.0 || (1e-3..1e9).contains(&number.abs());
    let text = if is_plain { format!("{number} {unit}") } else { format!("{number:e} {unit}") };
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_never_longer_than_full() {
        assert_eq!(bar(1e300), bar(1.0));
        assert_eq!(bar(-1e300), bar(0.0));
        assert_eq!(bar(f64::NAN).chars().filter(|it| *it == '#').count(), 0);
    }
}
