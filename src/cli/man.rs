//! `nav-sim man`: manual pages.

use super::{Failure, Session};

/// Print the manual page of a command (without a name: of nav-sim itself)
#[derive(clap::Args, Debug)]
#[command(before_help = "\
Examples:
  nav-sim man > nav-sim.1
  nav-sim man run > nav-sim-run.1
  nav-sim man compare > nav-sim-compare.1")]
pub(crate) struct Args {
    /// Which command
    command: Option<String>,
}

pub(crate) fn run(args: &Args, session: &Session) -> Result<(), Failure> {
    let mut page = Vec::new();
    let root = super::command();
    let of_command = match &args.command {
        None => root,
        Some(name) => subcommand(root, name)?,
    };
    clap_mangen::Man::new(of_command)
        .render(&mut page)
        .map_err(Failure::could_not)?;
    session.result(String::from_utf8_lossy(&page).trim_end());
    Ok(())
}

/// A subcommand with the common flags, which clap hands down when it builds.
fn subcommand(mut root: clap::Command, name: &str) -> Result<clap::Command, Failure> {
    root.build();
    let found = root
        .get_subcommands()
        .find(|c| c.get_name() == name)
        .cloned();
    let known = || {
        root.get_subcommands()
            .map(clap::Command::get_name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let unknown = || Failure::input(format!("no command is named \"{name}\"")).hint(known());
    Ok(found
        .ok_or_else(unknown)?
        .display_name(format!("nav-sim-{name}")))
}
