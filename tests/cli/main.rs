//! The program as its users run it: commands, files, messages.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::duplicate_mod,
    unreachable_pub,
    reason = "tests, some with figures"
)]

#[allow(dead_code, reason = "shared with the other tests")]
#[path = "../common/mod.rs"]
mod common;

mod batch;
mod calibrate;
mod choose;
mod command_line;
mod compare;
mod datasheet;
mod examples;
mod existing;
mod export;
mod file_commands;
mod fuse;
mod help_examples;
mod judge;
mod logs;
mod pages;
mod readme;
mod require;
mod run;
mod synthesize;
mod trajectory_command;
mod tune;
mod turn_on;
mod uncertainty;
