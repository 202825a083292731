//! `nav-sim completions`: completion scripts for shells.

/// Print a completion script for a shell
#[derive(clap::Args)]
#[command(before_help = "\
Examples:
  nav-sim completions bash > nav-sim.bash
  nav-sim completions zsh > _nav-sim
  nav-sim completions fish > nav-sim.fish")]
pub(crate) struct Args {
    /// Which shell
    #[arg(value_enum)]
    shell: clap_complete::Shell,
}

pub(crate) fn run(args: &Args) -> String {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut super::command(), "nav-sim", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}
