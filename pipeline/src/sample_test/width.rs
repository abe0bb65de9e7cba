//! Which vector instructions the kernel uses, chosen when the program runs.

use std::sync::LazyLock;

/// A width of vectors that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(pub(super) Vectors);

/// The widths the kernel is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vectors {
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

static WIDEST: LazyLock<Width> = LazyLock::new(|| Width::available().last().unwrap_or(Width(Vectors::Plain)));

impl Width {
    /// Every width of this machine, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        let mut widths = vec![Self(Vectors::Plain)];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                widths.push(Self(Vectors::Avx2));
            }
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                widths.push(Self(Vectors::Avx512));
            }
        }
        widths.into_iter()
    }

    /// The widest one of this machine.
    pub fn widest() -> Self {
        *WIDEST
    }
}
