//! The `treelet` command as its users meet it: the real binary, in a folder of its own.

mod bench;
mod errors;
mod frames;
mod interrupt;
mod kit;
mod measures;
mod render;
mod reports;
