//! Memory as the pipeline sees it: addresses, caches and what reaches the chips.

mod cache;
mod compress;
mod map;
mod system;

pub use cache::{Access, Cache, CacheError, CacheSpec, Replacement};
pub use compress::Compression;
pub(crate) use compress::depths_fit;
pub(crate) use map::Allocator;
pub use map::{AddressMap, LINE_BYTES};
pub use system::{MemorySpec, MemorySystem};
