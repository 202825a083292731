#![no_main]
//! The reader whose name is in `NAV_SIM_FUZZ_TARGET`, of all in `nav_sim::fuzz`.
//! One program: linking one for each takes longer than they run.

use std::env;
use std::sync::LazyLock;

static READER: LazyLock<fn(&[u8])> =
    LazyLock::new(|| nav_sim::fuzz::target(&env::var("NAV_SIM_FUZZ_TARGET").expect("the name of a reader")));

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| READER(bytes));
