//! Collision cases.

/// Moving triangles, each an object of its own with its corners at time 0 and 1, as `.mts` of 8-byte scalars.
pub fn mts(objects: &[[[[f64; 3]; 3]; 2]]) -> Vec<u8> {
    let mut data = b"MTS1".to_vec();
    [8, objects.len() as u32, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    objects.iter().for_each(|_| [3_u32, 1].iter().for_each(|word| data.extend(word.to_le_bytes())));
    for ends in objects {
        ends.as_flattened().as_flattened().iter().for_each(|number| data.extend(number.to_le_bytes()));
        [0_u32, 1, 2].iter().for_each(|index| data.extend(index.to_le_bytes()));
    }
    data
}
