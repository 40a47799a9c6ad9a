//! The `treelet` command as its users meet it: the real binary, in a folder of its own.

mod animate;
mod bench;
mod choice;
mod errors;
mod figure;
mod frames;
mod interrupt;
mod kit;
mod measures;
mod page;
mod render;
mod reports;
