//! Reflection and refraction at a smooth surface.

use glam::DVec3;

/// Direction of a reflected ray. `incoming` and `normal` have unit length.
pub fn reflect(incoming: DVec3, normal: DVec3) -> DVec3 {
    incoming - 2.0 * incoming.dot(normal) * normal
}

/// Direction of a refracted ray (Snell); `None` for total reflection. `normal` points against `incoming`,
/// both of unit length. `ratio` is the refractive index on this side over that on the other.
pub fn refract(incoming: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cos_in = -incoming.dot(normal);
    let cos_out_squared = 1.0 - ratio * ratio * (1.0 - cos_in * cos_in);
    (cos_out_squared >= 0.0)
        .then(|| ratio * incoming + (ratio * cos_in - libm::sqrt(cos_out_squared)) * normal)
}

/// Share of unpolarized light that is transmitted (Fresnel), for the cosines of both angles and the ratio of
/// [`refract`].
pub fn transmission(cos_in: f64, cos_out: f64, ratio: f64) -> f64 {
    let across = (ratio * cos_in - cos_out) / (ratio * cos_in + cos_out);
    let along = (ratio * cos_out - cos_in) / (ratio * cos_out + cos_in);
    1.0 - 0.5 * (across * across + along * along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refraction_follows_snell_and_stays_in_the_plane() {
        let normal = DVec3::Y;
        for degrees in [0.0_f64, 20.0, 45.0, 80.0] {
            let angle = degrees.to_radians();
            let incoming = DVec3::new(angle.sin(), -angle.cos(), 0.0);
            let out = refract(incoming, normal, 1.0 / 1.33).unwrap();
            assert!((out.length() - 1.0).abs() < 1e-12 && out.z == 0.0);
            assert!((1.33 * out.x - incoming.x).abs() < 1e-12, "{degrees}");
            assert!((reflect(incoming, normal) - DVec3::new(incoming.x, -incoming.y, 0.0)).length() < 1e-15);
        }
        let grazing = DVec3::new(0.9, -(1.0_f64 - 0.81).sqrt(), 0.0);
        assert!(refract(grazing, normal, 1.33).is_none(), "beyond the critical angle all is reflected");
    }

    #[test]
    fn transmission_follows_fresnel() {
        // Normal incidence: 4 n1 n2 / (n1 + n2)^2. At Brewster's angle the light polarized along the plane is
        // transmitted completely.
        assert!((transmission(1.0, 1.0, 1.0 / 1.5) - 0.96).abs() < 1e-12);
        let brewster = 1.5_f64.atan();
        let (cos_in, cos_out) = (brewster.cos(), brewster.sin());
        let across = ((1.0 / 1.5 * cos_in - cos_out) / (1.0 / 1.5 * cos_in + cos_out)).powi(2);
        assert!((transmission(cos_in, cos_out, 1.0 / 1.5) - (1.0 - 0.5 * across)).abs() < 1e-12);
        // Transmission is the same in both directions.
        assert!(
            (transmission(0.8, 0.9, 1.0 / 1.2) - transmission(0.9, 0.8, 1.2)).abs() < 1e-12,
            "the same for both directions"
        );
    }
}
