//! `nav-sim`: the command line of the library.

fn main() -> std::process::ExitCode {
    nav_sim::cli::main()
}
