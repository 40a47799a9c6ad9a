//! Layouts: the packed forms of a tree that a walk reads.

pub(crate) mod collapse;
pub mod compact;
pub(crate) mod exchange;
mod greedy;
mod leaves;
pub(crate) mod lower;
pub(crate) mod moving;
mod order;
pub(crate) mod packing;
pub(crate) mod refit;
pub(crate) mod repair;
mod select;
pub mod wide;
mod write;

use crate::build::Info;

/// Every layout, in the order of the documentation.
pub static ALL: &[Info] = &[wide::INFO_8, wide::INFO_16, compact::INFO];

/// Which nodes of the binary tree become nodes of a wide layout. Answers do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Collapse {
    /// The cheapest choice there is.
    #[default]
    Optimal,
    /// The largest first: a fifth to a third less build time than `Optimal` with quick builders; 0 to 17 %
    /// fewer rays a second (a kitchen, a car, a house).
    Greedy,
}
