//! Memory of the pipeline: addresses, caches and traffic to the chips.

mod cache;
mod system;

pub use cache::{Access, Cache, CacheError, CacheSpec, Replacement};
pub use system::{AddressMap, Compression, LINE_BYTES, MemorySpec, MemorySystem};
pub(crate) use system::{Allocator, depths_fit};
