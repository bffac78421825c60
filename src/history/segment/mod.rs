//! Segments: the files in which one process stores runs of one campaign. Each is written once, at
//! its end; nothing in it changes afterwards.
//!
//! A segment has a file for each column, so that lists read a part of a hundredth. All files of a
//! segment have its number as their name. A run is complete once its frame in the column of runs is
//! written, which is the last one.

mod encode;
mod file;
mod frame;
