//! x
#![allow(missing_docs)]
pub use formats;
pub use kernel;

mod accelerator;
mod intersect;

pub use accelerator::{Accelerator, Workspace};
pub use intersect::{Hit, METHODS, Method};
