use super::*;

#[test]
fn every_family_makes_every_value_the_same_each_time() {
    for family in families() {
        assert!(family.values.len() > family.slow + 1, "{}", family.name);
        for &value in family.sweep(true) {
            let [once, again, other] = [1, 1, 2].map(|seed| family.scene(value, Size::SMALL, seed).unwrap());
            assert!(!once.triangles.is_empty(), "{} at {value}", family.name);
            assert_eq!((&once.open, &once.close), (&again.open, &again.close), "{} at {value}", family.name);
            assert_eq!(once.triangles.len(), other.triangles.len());
        }
    }
}

#[test]
fn names_are_unique_and_lead_back() {
    for known in families() {
        assert_eq!(family(known.name).map(|found| found.what), Some(known.what));
        assert_eq!(families().filter(|other| other.name == known.name).count(), 1);
    }
    assert!(family("no such family").is_none());
}

#[test]
fn a_side_that_is_no_power_of_two_is_refused() {
    let family = family("slivers").unwrap();
    let error = family.scene(1.0, Size { side_px: 100, triangles: 3 }, 1).unwrap_err();
    assert!(error.to_string().contains("100"), "{error}");
}
