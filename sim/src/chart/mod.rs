//! `quintile chart NAME`: charts of what a method gains over what it costs.

pub mod tile_tests;
