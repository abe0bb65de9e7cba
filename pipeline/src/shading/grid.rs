//! The shading grid: cells of one pixel at the reference lens position and time.

/// The time at which the shading grid is laid over a triangle.
pub const REFERENCE_TIME: f32 = 0.5;

/// Cells are kept within this many of the image centre, so that their coordinates fit any use.
const FARTHEST: f32 = 1e6;

/// The cell, in pixels from the top left of the image, that the point with the given barycentric `weights` falls into.
/// `reference` holds the vertices at the reference, `origin` the image coordinate of the first column and row. `None`
/// when the point is behind the camera there.
pub fn cell(reference: &[[f32; 3]; 3], weights: [f32; 3], origin: [f32; 2]) -> Option<[i32; 2]> {
    let mix = |axis: usize| (0..3).map(|k| weights[k] * reference[k][axis]).sum::<f32>();
    let w = mix(2);
    (w > 0.0)
        .then(|| [0, 1].map(|axis| (mix(axis) / w - origin[axis]).clamp(-FARTHEST, FARTHEST).floor() as i32))
}

/// Barycentric weights of the middle of a cell, which lies outside the triangle for cells its border crosses: shading
/// extrapolates there, as pixel centres do.
pub fn cell_weights(reference: &[[f32; 3]; 3], cell: [i32; 2], origin: [f32; 2]) -> [f32; 3] {
    weights_at(reference, [0, 1].map(|axis| cell[axis] as f32 + 0.5 + origin[axis]))
}

/// Barycentric weights of the point of a triangle seen at image coordinate `at`, extrapolated outside. Where the triangle
/// is seen edge on, its middle stands for all of it.
pub fn weights_at(vertices: &[[f32; 3]; 3], at: [f32; 2]) -> [f32; 3] {
    let seen = vertices.map(|[x, y, w]| [x - at[0] * w, y - at[1] * w]);
    let edge = |i: usize, j: usize| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1];
    let e = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sum = e[0] + e[1] + e[2];
    let weights = e.map(|part| part / sum);
    if weights.iter().all(|w| w.abs() < 64.0) { weights } else { [1.0 / 3.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f32; 3]; 3] = [[-8.0, -8.0, 1.0], [16.0, -16.0, 2.0], [-8.0, 8.0, 1.0]];

    #[test]
    fn the_middle_of_a_cell_falls_into_it() {
        let origin = [-32.0, -32.0];
        for target in [[25, 27], [30, 26], [24, 33]] {
            let weights = cell_weights(&TRIANGLE, target, origin);
            assert_eq!(cell(&TRIANGLE, weights, origin), Some(target));
        }
    }

    #[test]
    fn edge_on_and_behind_are_safe() {
        let line = [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
        assert_eq!(cell_weights(&line, [0, 0], [0.0, 0.0]), [1.0 / 3.0; 3]);
        let behind = TRIANGLE.map(|[x, y, w]| [x, y, -w]);
        assert_eq!(cell(&behind, [1.0 / 3.0; 3], [0.0, 0.0]), None);
        assert!(cell(&TRIANGLE, [f32::NAN; 3], [0.0, 0.0]).is_none());
    }
}
