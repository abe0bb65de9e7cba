//! Memory of the pipeline: addresses, caches and traffic to the chips.

mod address;
mod cache;
mod shared;
mod system;

pub use address::{AddressSpace, LINE_BYTES, MemoryRange};
pub use cache::{Access, Cache, CacheError, CacheSpec, Replacement};
pub(crate) use system::depths_fit;
pub use system::{Compression, MemorySpec, MemorySystem};
