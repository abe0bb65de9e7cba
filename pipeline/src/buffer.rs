//! Buffers: typed data of a frame, in words of 32 bits.

use std::marker::PhantomData;
use std::sync::Arc;

use crate::memory::MemoryRange;

/// An atomic operation on a word, an unsigned integer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Atomic {
    /// Sum, modulo 2^32.
    Add,
    /// Smaller of both.
    Min,
    /// Larger of both.
    Max,
    /// Bits that both have.
    And,
    /// Bits that either has.
    Or,
}

impl Atomic {
    /// The word that replaces `before`.
    pub fn of(self, before: u32, value: u32) -> u32 {
        match self {
            Self::Add => before.wrapping_add(value),
            Self::Min => before.min(value),
            Self::Max => before.max(value),
            Self::And => before & value,
            Self::Or => before | value,
        }
    }
}

/// A value of 32 bits, as it is in a buffer or in shared memory.
pub trait Word: Copy + Send + Sync {
    /// Bits of the word.
    fn bits(self) -> u32;
    /// The value with these bits.
    fn of(bits: u32) -> Self;
}

impl Word for u32 {
    fn bits(self) -> u32 {
        self
    }
    fn of(bits: u32) -> Self {
        bits
    }
}

impl Word for f32 {
    fn bits(self) -> u32 {
        self.to_bits()
    }
    fn of(bits: u32) -> Self {
        Self::from_bits(bits)
    }
}

/// A buffer of a frame.
#[derive(Debug)]
pub struct Buffer<T> {
    number: u32,
    words: u32,
    region: MemoryRange,
    of: PhantomData<fn() -> T>,
}

impl<T> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Buffer<T> {}

impl<T> Buffer<T> {
    /// Number in the frame.
    pub(crate) fn number(&self) -> u32 {
        self.number
    }

    /// Where it lies in memory.
    pub fn region(&self) -> MemoryRange {
        self.region
    }

    /// Number of values.
    pub fn len(&self) -> u32 {
        self.words
    }

    /// Whether it has no values.
    pub fn is_empty(&self) -> bool {
        self.words == 0
    }

    /// The buffer, for a pass that reads it.
    pub fn reads(&self) -> BufferBinding {
        BufferBinding { number: self.number, region: self.region, access: Access::Read }
    }

    /// The buffer, for a pass that writes it.
    pub fn writes(&self) -> BufferBinding {
        BufferBinding { access: Access::Write, ..self.reads() }
    }
}

/// What a pass does with a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Loads.
    Read,
    /// Loads, stores and atomics.
    Write,
}

/// A buffer of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferBinding {
    number: u32,
    pub(crate) region: MemoryRange,
    pub(crate) access: Access,
}

impl BufferBinding {
    /// Number of the buffer in the frame.
    pub(crate) fn number(&self) -> u32 {
        self.number
    }
}

/// Name, place and words of a buffer.
#[derive(Clone, Debug)]
struct Data {
    name: String,
    region: MemoryRange,
    words: Arc<Vec<u32>>,
    /// Whether it is a view of a surface that has other contents by now.
    is_outdated: bool,
}

/// All buffers of a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Buffers(Vec<Data>);

/// Words of a buffer for the shaders of a draw, as they are before its pass.
#[derive(Clone, Debug)]
pub(crate) struct BoundBuffer {
    number: u32,
    address: u64,
    words: Arc<Vec<u32>>,
}

impl BoundBuffer {
    /// The word of buffer `number` at `index`, and its address, if this is the buffer and has it.
    pub fn word(&self, number: u32, index: u32) -> Option<(u32, u64)> {
        let word = self.words.get(index as usize).filter(|_| number == self.number)?;
        Some((*word, self.address + 4 * u64::from(index)))
    }
}

/// A store or an atomic that takes effect later.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stored {
    pub buffer: u32,
    pub index: u32,
    /// `None` for a store.
    pub atomic: Option<Atomic>,
    pub bits: u32,
}

impl Buffers {
    /// Adds a buffer of `data` in `region`.
    pub fn add<T: Word>(&mut self, name: &str, region: MemoryRange, data: &[T]) -> Buffer<T> {
        let words = Arc::new(data.iter().map(|value| value.bits()).collect());
        self.0.push(Data { name: name.to_owned(), region, words, is_outdated: false });
        let number = self.0.len() as u32 - 1;
        Buffer { number, words: data.len() as u32, region, of: PhantomData }
    }

    /// The values of a buffer.
    pub fn values<T: Word>(&self, buffer: Buffer<T>) -> Vec<T> {
        self.0[buffer.number as usize].words.iter().map(|&bits| T::of(bits)).collect()
    }

    /// Number of buffers.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn name(&self, buffer: u32) -> &str {
        &self.0[buffer as usize].name
    }

    pub fn words(&self, buffer: u32) -> u32 {
        self.0[buffer as usize].words.len() as u32
    }

    /// Address of a word.
    pub fn address(&self, buffer: u32, index: u32) -> u64 {
        self.0[buffer as usize].region.address() + 4 * u64::from(index)
    }

    /// Whether the frame has the buffer of a binding.
    pub fn has(&self, binding: &BufferBinding) -> bool {
        self.0.get(binding.number as usize).is_some_and(|data| data.region == binding.region)
    }

    /// Lets no pass use the views of the surface in `region` any more.
    pub fn outdate(&mut self, region: MemoryRange) {
        let views = self.0.iter_mut().filter(|data| data.region == region);
        views.for_each(|data| data.is_outdated = true);
    }

    pub fn is_outdated(&self, buffer: u32) -> bool {
        self.0[buffer as usize].is_outdated
    }

    /// All words of a bound buffer as they are now.
    pub fn bound(&self, binding: &BufferBinding) -> Option<BoundBuffer> {
        let words = Arc::clone(&self.0.get(binding.number as usize)?.words);
        Some(BoundBuffer { number: binding.number, address: binding.region.address(), words })
    }

    /// A word of a buffer that has it.
    pub fn word(&self, buffer: u32, index: u32) -> u32 {
        self.0[buffer as usize].words[index as usize]
    }

    /// Lets a store or an atomic take effect.
    pub fn apply(&mut self, stored: &Stored) {
        let word = &mut Arc::make_mut(&mut self.0[stored.buffer as usize].words)[stored.index as usize];
        *word = stored.atomic.map_or(stored.bits, |atomic| atomic.of(*word, stored.bits));
    }
}
