//! What several tests need: the built program, and folders of their own.

pub mod chromium;
