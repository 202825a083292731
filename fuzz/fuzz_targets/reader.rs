#![no_main]
//! The reader whose name is in `READER`: all are in `nav_sim::fuzz`. One program, since linking one for each takes longer than they run.

use std::env;
use std::sync::LazyLock;

static READER: LazyLock<fn(&[u8])> = LazyLock::new(|| nav_sim::fuzz::target(&env::var("READER").expect("READER names a reader")));

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| READER(bytes));
