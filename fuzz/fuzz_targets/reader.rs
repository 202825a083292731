#![no_main]
//! The reader whose name is in `NAV_SIM_FUZZ_TARGET`, of all in `nav_sim::fuzz`.
//! One program: linking one for each takes longer than they run.

use std::env;
use std::sync::LazyLock;

static READER: LazyLock<String> =
    LazyLock::new(|| env::var("NAV_SIM_FUZZ_TARGET").expect("the name of a reader"));

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| nav_sim::fuzz::read(&READER, bytes));
