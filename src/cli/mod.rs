//! The commands of the program.

mod administration;
mod client;
mod doctor;
mod fit;
mod health;
mod listening;
mod moving;
mod parts;
mod places;
mod printing;
mod remote;
mod report;
mod run;
mod runtime;
mod serve;
mod signals;
mod study;
mod worker;

use std::fs;
use std::process::ExitCode;

use clap::FromArgMatches as _;
use fretwork_engine::simulation::model_error;

use self::printing::{Ended, Error, print};
use crate::config::{self, Cli, Command};
use crate::http;
use fretwork_verify::{self as verification, Accuracy};

/// The seed of the random scenarios on the verification page.
const SEED: u64 = 16;

/// Executes the command in the arguments of the process, and returns the exit code. It may change the umask and the
/// panic hook.
pub fn main() -> ExitCode {
    let matches = config::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    // The user may want to share the files of these commands, so others may read them.
    if !matches!(
        cli.command,
        Some(
            Command::Run(_)
                | Command::Get(_)
                | Command::Report(_)
                | Command::Man { .. }
                | Command::Export(_)
        )
    ) {
        restrict_permissions();
    }
    let done = match cli.command {
        None => serve::serve(&cli.serve, &matches),
        Some(Command::Serve(settings)) => {
            let matches = matches.subcommand_matches("serve").unwrap_or(&matches);
            serve::serve(&settings, matches)
        }
        Some(Command::Worker(settings)) => worker::work(&settings),
        Some(Command::Run(settings)) => run::run(settings),
        Some(Command::Fit(settings)) => fit::fit(&settings),
        Some(Command::Report(settings)) => report::report(&settings),
        Some(Command::Submit(settings)) => remote::submit(&settings),
        Some(Command::Get(settings)) => remote::get(&settings),
        Some(Command::Watch(settings)) => remote::watch(&settings),
        Some(Command::List(settings)) => remote::list(&settings),
        Some(Command::Cancel(settings)) => remote::cancel(&settings),
        Some(Command::Evaluate(settings)) => remote::evaluate(&settings),
        Some(Command::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut config::command(), "fretwork", &mut script);
            print(&script)
        }
        Some(Command::Man { directory }) => {
            let made = fs::create_dir_all(&directory)
                .and_then(|()| clap_mangen::generate_to(config::command(), &directory));
            made.map_err(|error| format!("cannot write {}: {error}", directory.display()).into())
        }
        Some(Command::Openapi) => print(http::DOCUMENT),
        Some(Command::Verify { exact_volumes: true, .. }) => {
            print(model_error::exact_volumes().as_bytes())
        }
        Some(Command::Verify { random: Some(count), .. }) => {
            let accuracy = Accuracy::measured(count.get(), SEED);
            print(accuracy.to_string().as_bytes())
        }
        Some(Command::Verify { .. }) => verify(),
        Some(Command::Health(settings)) => health::health(&settings),
        Some(Command::Doctor(settings)) => doctor::doctor(&settings),
        Some(Command::Keys(command)) => administration::keys(command),
        Some(Command::Audit(data)) => administration::audit(&data),
        Some(Command::Export(settings)) => moving::export(&settings),
        Some(Command::Import(settings)) => moving::import(&settings),
        Some(Command::Check { repair, data }) => moving::check(&data, repair),
        Some(Command::Backup(settings)) => moving::backup(&settings),
        Some(Command::Restore(settings)) => moving::restore(&settings),
    };
    ExitCode::from(done.map_or_else(|error| Ended::of(&error).print(), |()| 0))
}

/// Makes new files readable for their owner only. They contain the jobs of all users and the key that signs links.
fn restrict_permissions() {
    #[cfg(unix)]
    rustix::process::umask(rustix::fs::Mode::from_raw_mode(0o077));
}

/// Prints the verification page. A failed check is an error.
fn verify() -> Result<(), Error> {
    let page = verification::page();
    print(page.to_string().as_bytes())?;
    match page.failures().count() {
        0 => Ok(()),
        1 => Err("1 check on the page above fails".into()),
        failed => Err(format!("{failed} checks on the page above fail").into()),
    }
}
