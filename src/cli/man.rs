//! `nav-sim man`: manual pages.

use super::Failure;

/// Print the manual page of a command (without a name: of nav-sim itself)
#[derive(clap::Args)]
#[command(before_help = "\
Examples:
  nav-sim man > nav-sim.1
  nav-sim man run > nav-sim-run.1
  nav-sim man compare > nav-sim-compare.1")]
pub(crate) struct Args {
    /// Which command
    command: Option<String>,
}

pub(crate) fn run(args: &Args) -> Result<String, Failure> {
    let mut page = Vec::new();
    let mut root = super::command();
    // hands the common flags down
    root.build();
    let of_command = match &args.command {
        None => root,
        Some(name) => {
            let names = root.get_subcommands().map(clap::Command::get_name);
            let known = names.collect::<Vec<_>>().join(", ");
            let found = root.find_subcommand(name).cloned();
            let unknown = format!("no command is named \"{name}\"");
            let found = found.ok_or_else(|| Failure::input(unknown).hint(known))?;
            found.display_name(format!("nav-sim-{name}"))
        }
    };
    clap_mangen::Man::new(of_command)
        .render(&mut page)
        .map_err(Failure::could_not)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}
