//! What stays as long as others leave, and when it may leave all the same: parts that are to be kept, and the base.
//!
//! Where nothing else leaves any more, first a base leaves that was chosen here, then what is to be kept, and last a base
//! that the request gave. After each removal all of it stays again.

/// Which parts may leave beside those that are asked for; each with those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Release {
    /// No others.
    #[default]
    Nothing,
    /// A base that was chosen.
    ChosenBase,
    /// Parts that are to be kept.
    Kept,
    /// A base that the request gave.
    GivenBase,
}
