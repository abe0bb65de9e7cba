//! Memory of the pipeline: addresses, caches and traffic to the chips.

mod cache;
mod layout;
mod system;

pub use cache::{Access, Cache, CacheError, CacheSpec, Replacement};
pub use layout::{AddressMap, Compression, LINE_BYTES};
pub(crate) use layout::{Allocator, depths_fit};
pub use system::{MemorySpec, MemorySystem};
