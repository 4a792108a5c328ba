//! The diagnosis: which effects of the catalogue a recording shows.

mod candidate;
mod chi_square;
mod fit;
mod noise;
mod parallel;
mod select;
mod starts;
mod term;
mod touch;
mod unit;
mod white;
