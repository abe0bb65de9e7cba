//! What a sample test costs, counted from the kernel.

/// Multiply-adds of one sample test; a lone addition or multiplication counts as one.
///
/// For each vertex: one for each coordinate that moves with time, one for each axis sheared by the lens, and one for
/// each axis translated to the sample, in perspective or not. For the edges two each. For the depth: two additions, three multiply-adds and a
/// division.
pub const fn madds(moving: bool, lens: bool) -> u32 {
    let vertex = 2 + if moving { 3 } else { 0 } + if lens { 2 } else { 0 };
    3 * vertex + 3 * 2 + 6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_dimension_costs_what_the_kernel_adds() {
        assert_eq!(
            [madds(false, false), madds(true, false), madds(false, true), madds(true, true)],
            [18, 27, 24, 33]
        );
    }
}
