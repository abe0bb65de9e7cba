//! Point lights at fixed positions.

use glam::Vec3;

use crate::lighting::PointLight;
use crate::scene::Frame;

/// Steps of the low-discrepancy sequence in three dimensions (the generalized golden ratio, Roberts 2018).
const STEPS: [f64; 3] = [0.819_172_513_396_164_5, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];
/// Radiance of a white surface next to a light, all channels together.
const BRIGHTNESS: f32 = 1.5;

/// `count` lights of `range` scene units within `bounds`. Colours go around the hues; the first lights of more are the same.
pub fn point_lights([low, high]: [Vec3; 2], count: u32, range: f32) -> Vec<PointLight> {
    let part = |number: u32, axis: usize| {
        let at = 0.5 + STEPS[axis] * f64::from(number);
        (at - libm::floor(at)) as f32
    };
    let light = |number| {
        let place = Vec3::from_array([0, 1, 2].map(|axis| part(number, axis)));
        let color = Vec3::from_array([0, 1, 2].map(|axis| 0.2 + part(number, axis)));
        let color = color * (BRIGHTNESS / (color.x + color.y + color.z));
        PointLight { position: low + place * (high - low), color, range }
    };
    (1..=count).map(light).collect()
}

/// Box around the visible meshes of a frame, by the middle four fifths of their vertices along each axis: a few far ones (a floor to
/// the horizon) do not take the lights away from the rest.
pub(super) fn bounds(frame: &Frame) -> [Vec3; 2] {
    let mut along = [0, 1, 2].map(|axis| {
        let all = frame.meshes.iter().flat_map(|mesh| mesh.open.iter());
        all.map(|point| point[axis]).collect::<Vec<f32>>()
    });
    let [low, high] = [0.1, 0.9].map(|share| {
        Vec3::from_array(along.each_mut().map(|values| {
            let place = (share * values.len() as f64) as usize;
            let place = place.min(values.len().saturating_sub(1));
            if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(place, f32::total_cmp).1 }
        }))
    });
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_lights_leave_the_first_where_they_are() {
        let bounds = [Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 4.0)];
        let [few, many] = [4, 64].map(|count| point_lights(bounds, count, 2.0));
        assert_eq!(few[..], many[..4]);
        assert!(many.iter().all(|light| light.position.cmpge(bounds[0]).all()));
        assert!(many.iter().all(|light| light.position.cmple(bounds[1]).all()));
        let sum = |light: &PointLight| light.color.x + light.color.y + light.color.z;
        assert!(many.iter().all(|light| (sum(light) - BRIGHTNESS).abs() < 1e-5));
    }
}
