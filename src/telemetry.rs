//! Logs to standard error, as text or as JSON, and announcements to standard output in the same format.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};

use clap::{Args, ValueEnum};
use serde_json::json;
use tracing_subscriber::Layer as _;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use fretwork_job::clock::{now, rfc3339};

/// The format of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    /// Text for people.
    Text,
    /// One JSON object per line, for machines.
    Json,
}

/// The options of the log.
#[derive(Debug, Clone, Args)]
pub struct Logging {
    /// Level of the log: off, error, warn, info, debug or trace; for single modules as in info,sqlx=debug.
    #[arg(long, env = "FRETWORK_LOG", default_value = "info", value_name = "LEVEL", value_parser = log_levels)]
    log: Targets,
    /// Format of the log.
    #[arg(long, env = "FRETWORK_LOG_FORMAT", default_value = "text")]
    log_format: LogFormat,
}

/// Parses the levels of the log: a level for all modules, and levels for named modules. Clients can make the HTTP/2
/// library (`h2`) log a warning for each frame. So it logs errors only, unless the text names it.
fn log_levels(text: &str) -> Result<Targets, String> {
    let levels = named_levels(text)?;
    let is_named = levels.iter().any(|(module, _)| module.starts_with("h2"));
    let is_quiet = levels.default_level().is_none_or(|level| level <= LevelFilter::ERROR);
    Ok(if is_named || is_quiet { levels } else { levels.with_target("h2", LevelFilter::ERROR) })
}

fn named_levels(text: &str) -> Result<Targets, String> {
    text.split(',').try_fold(Targets::new(), |levels, part| {
        let (module, name) = part.split_once('=').unwrap_or(("", part));
        let (module, name) = (module.trim(), name.trim());
        let level: Option<LevelFilter> = name.parse().ok().filter(|_| !name.is_empty());
        let level = level.ok_or_else(|| {
            format!(
                "{name:?} is not a level of the log; use off, error, warn, info, debug or trace"
            )
        })?;
        Ok(match module {
            "" => levels.with_default(level),
            module => levels.with_target(module, level),
        })
    })
}

impl Logging {
    /// Prints the announcement of a command on standard output, at every level of the log. With the text format this is
    /// `text`; with the JSON format it is an object with `message` and the `details`.
    pub fn announce(
        &self,
        text: &str,
        message: &str,
        details: &BTreeMap<&str, String>,
    ) -> io::Result<()> {
        let mut out = io::stdout().lock();
        match self.log_format {
            LogFormat::Text => out.write_all(text.as_bytes())?,
            LogFormat::Json => {
                let mut line = json!(details);
                line["timestamp"] = rfc3339(now()).into();
                line["level"] = "INFO".into();
                line["message"] = message.into();
                writeln!(out, "{line}")?;
            }
        }
        out.flush()
    }

    /// Starts logging.
    pub fn start(&self) {
        let lines = tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal());
        let lines = match self.log_format {
            LogFormat::Text => lines.boxed(),
            LogFormat::Json => lines.json().flatten_event(true).boxed(),
        };
        tracing_subscriber::registry().with(lines).with(self.log.clone()).init();
        // A panic becomes a log entry in the same format.
        std::panic::set_hook(Box::new(|panic| tracing::error!(%panic, "panicked")));
    }
}

#[cfg(test)]
mod tests {
    use tracing::Level;

    use super::*;

    #[test]
    fn the_log_has_one_level_and_others_for_named_modules() {
        let levels = log_levels("warn, sqlx=off,fretwork::http = DEBUG").unwrap();
        assert_eq!(levels.default_level(), Some(LevelFilter::WARN));
        let modules: Vec<_> = levels.iter().collect();
        let expected = [("sqlx", LevelFilter::OFF), ("fretwork::http", LevelFilter::DEBUG)];
        assert!(expected.iter().all(|level| modules.contains(level)), "{modules:?}");
        let logs_h2 = |text, level| log_levels(text).unwrap().would_enable("h2::proto", &level);
        for (text, warns, errors) in [
            ("info", false, true),
            ("debug", false, true),
            ("off", false, false),
            ("info,h2=warn", true, true),
        ] {
            assert_eq!(logs_h2(text, Level::WARN), warns, "{text}");
            assert_eq!(logs_h2(text, Level::ERROR), errors, "{text}");
        }
        for bad in ["", "loud", "warn,", "fretwork=", "fretwork"] {
            assert!(log_levels(bad).is_err(), "{bad}");
        }
    }
}
