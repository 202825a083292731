//! `nav-sim --version`, and with `--verbose` what this program was built for and what it uses here.

use nav_sim_navigation::lanes::Level;
use std::env::consts::{ARCH, OS};

/// The version; more where the words of the command line ask for it.
pub(super) fn version(words: &[String]) -> String {
    let number = env!("CARGO_PKG_VERSION").to_owned();
    let is_version = |w: &String| w == "--version" || w == "-V";
    let is_verbose = |w: &String| w == "--verbose" || w == "-v";
    let short = words.iter().any(|w| matches!(w.as_str(), "-vV" | "-Vv"));
    let asked = short || (words.iter().any(is_version) && words.iter().any(is_verbose));
    if !asked {
        return number;
    }
    let library = if cfg!(target_env = "musl") {
        "musl"
    } else {
        "gnu"
    };
    let linked = if cfg!(target_feature = "crt-static") {
        "static"
    } else {
        "dynamic"
    };
    let profile = if cfg!(debug_assertions) {
        "debug"
    } else {
        "release"
    };
    let level = Level::best();
    let features = match (cfg!(feature = "pictures"), cfg!(feature = "parquet")) {
        (true, true) => "pictures, parquet",
        (true, false) => "pictures",
        (false, true) => "parquet",
        (false, false) => "none",
    };
    format!(
        "{number}\nbuild         {profile}, {ARCH}-{OS}-{library}, {linked}\nvector units  {level}\nfeatures      {features}"
    )
}
