#![no_main]
//! The reader whose name the binary has: all are in `nav_sim::fuzz`.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| nav_sim::fuzz::target(env!("CARGO_BIN_NAME"))(bytes));
