//! All integration tests in one program: the large libraries are linked once.

mod broken;
mod campaign;
mod floors;
mod support;
