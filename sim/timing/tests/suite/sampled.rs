//! Frames estimated from few: closed forms, and coverage of the intervals.

use proptest::prelude::*;
use timing::sampled::{Design, Estimate, Interval};

/// SplitMix64 (Steele, Lea and Flood 2014): a random word for each counter.
fn word(seed: u64, counter: u64) -> u64 {
    let mix = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    mix(mix(seed.wrapping_add(0x9E37_79B9_7F4A_7C15)) ^ counter.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

fn unit(seed: u64, counter: u64) -> f64 {
    (word(seed, counter) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Nearly normal: the sum of twelve uniform numbers.
fn normal(seed: u64, counter: u64) -> f64 {
    (0..12).map(|k| unit(seed, 12 * counter + k)).sum::<f64>() - 6.0
}

fn estimate(x: &[f64], y: &[f64], count: usize, seed: u64) -> (Design, Estimate) {
    let design = Design::draw(x, Some(x.len() / 2), count, |unit| word(seed, unit));
    let estimate = Estimate::new(&design, x, |unit| y[unit]);
    (design, estimate)
}

/// A kind of animation: covariate and truth of frame `k` of `n`.
type Animation = fn(u64, usize, usize) -> (f64, f64);

/// A slow turn with a periodic gait; a cut from a light to a heavy scene; an uninformative signature; a
/// curved relation; noise that grows with the frame.
const ANIMATIONS: [(&str, Animation); 5] = [
    ("gait", |seed, k, n| {
        let turn = (k as f64 / n as f64 * 6.0).sin() + 0.3 * (k as f64 * 0.7).sin();
        (
            100.0 + 10.0 * turn + normal(seed, k as u64),
            1000.0 + 100.0 * turn + 8.0 * normal(seed + 1, k as u64),
        )
    }),
    ("cut", |seed, k, n| {
        let level = if k * 3 < n { 1.0 } else { 2.0 };
        (level + 0.02 * normal(seed, k as u64), 50.0 * level + normal(seed + 1, k as u64))
    }),
    ("blind", |seed, k, _| (normal(seed, k as u64), 500.0 + 20.0 * normal(seed + 1, k as u64))),
    ("bend", |seed, k, n| {
        let x = 1.0 + k as f64 / n as f64;
        (x, 10.0 * x * x + 0.3 * normal(seed, k as u64))
    }),
    ("growing", |seed, k, n| {
        let x = 1.0 + 3.0 * k as f64 / n as f64;
        (x, x * (10.0 + 0.4 * normal(seed, k as u64)))
    }),
];

fn animation(of: Animation, seed: u64, n: usize) -> (Vec<f64>, Vec<f64>) {
    (0..n).map(|k| of(seed, k, n)).unzip()
}

fn holds(interval: &Interval, truth: f64) -> bool {
    (interval.low..=interval.high).contains(&truth)
}

/// Coverage of the 95 % interval is 91 to 99 %, over 6000 trials. That many trials would show an error of one
/// percent.
#[test]
fn the_coverage_of_intervals_is_nominal() {
    let (mut inside, mut trials) = (0, 0);
    for (name, of) in ANIMATIONS {
        for count in [6, 12, 30] {
            let mut held = 0;
            for seed in 0..400_u64 {
                let (x, y) = animation(of, seed % 20, 300);
                let (_, found) = estimate(&x, &y, count, 1000 + seed);
                held += u32::from(holds(&found.total(0.95), y.iter().sum()));
            }
            let share = f64::from(held) / 400.0;
            assert!((0.88..=0.995).contains(&share), "{name}, {count} frames: {share}");
            inside += held;
            trials += 400;
        }
    }
    let share = f64::from(inside) / f64::from(trials);
    assert!((0.93..=0.98).contains(&share), "over all: {share}");
}

/// Coverage for the ratio of two quantities, such as power, and for single frames.
#[test]
fn the_coverage_of_ratios_and_single_frames_is_nominal() {
    let (mut ratios, mut singles, mut frames) = (0, 0, 0);
    let of = ANIMATIONS[0].1;
    for seed in 0..400_u64 {
        let (x, time) = animation(of, seed % 20, 300);
        let energy: Vec<f64> =
            time.iter().zip(0..).map(|(time, k)| 3.0 * time + 40.0 * normal(seed % 20 + 50, k)).collect();
        let (design, below) = estimate(&x, &time, 10, 77 + seed);
        let above = Estimate::new(&design, &x, |unit| energy[unit]);
        let truth = energy.iter().sum::<f64>() / time.iter().sum::<f64>();
        ratios += u32::from(holds(&above.ratio(&below, 0.95), truth));
        let chosen = design.chosen();
        for unit in (0..300).filter(|unit| !chosen.contains(unit)) {
            let half = below.half_width_of_one(design.stratum_of(unit), 0.95);
            singles += u32::from((below.predicted(unit) - time[unit]).abs() <= half);
            frames += 1;
        }
    }
    let [ratios, singles] = [f64::from(ratios) / 400.0, f64::from(singles) / f64::from(frames)];
    assert!((0.91..=0.99).contains(&ratios), "ratios: {ratios}");
    assert!((0.91..=0.99).contains(&singles), "single frames: {singles}");
}

/// An informative signature gives a narrower interval than the mean of as many frames.
#[test]
fn an_informative_signature_narrows_the_interval() {
    let (x, y) = animation(ANIMATIONS[0].1, 3, 300);
    let blind = vec![0.0; 300];
    let width = |x: &[f64]| {
        let widths = (0..100).map(|seed| estimate(x, &y, 12, seed).1.total(0.95).relative());
        widths.sum::<f64>() / 100.0
    };
    assert!(width(&x) < 0.4 * width(&blind), "{} {}", width(&x), width(&blind));
}

#[test]
fn by_hand() {
    // Two strata, {0, 1, 2, 3} and {4, 5, 6, 7}: all frames are equal except for a step of 10 between the
    // strata, and one frame that differs by 2.
    let x = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    let design = Design::draw(&x, None, 4, |unit| unit % 4);
    let chosen: Vec<_> = design.strata().iter().map(|stratum| stratum.chosen.clone()).collect();
    assert_eq!(chosen, [[0, 1], [4, 5]]);
    let y = |unit: usize| [1.0, 3.0, 9.0, 9.0, 12.0, 12.0, 9.0, 9.0][unit];
    let found = Estimate::new(&design, &x, y);
    // Means of 2 and 12; the signature is constant in each stratum, so the slope takes no degree of freedom.
    let total = found.total(0.95);
    assert!((total.value - (4.0 * 2.0 + 4.0 * 12.0)).abs() < 1e-12);
    // Variance: 4 (4 - 2) / 2 times a spread of 2 = 8; two degrees of freedom.
    assert!((total.high - total.value - 4.302_652_7 * 8.0_f64.sqrt()).abs() < 1e-6);
    assert_eq!([found.predicted(2), found.predicted(6)], [2.0, 12.0]);
}

/// Two strata of two, covariates 0, 1 and 4, 5, values 0, 2 and 4, 4: the regression has the slope 13/17 and
/// takes 1/17 of the two degrees of freedom within strata.
#[test]
fn by_hand_with_a_slope() {
    let x = [0.0, 1.0, 0.5, 4.0, 5.0, 4.5];
    let design = Design::draw(&x, None, 4, |unit| [0, 1, 9, 0, 1, 9][unit as usize]);
    assert_eq!(design.chosen(), [0, 1, 3, 4]);
    let found = Estimate::new(&design, &x, |unit| [0.0, 2.0, f64::NAN, 4.0, 4.0][unit]);
    let slope = 13.0 / 17.0;
    assert!((found.predicted(0) - (1.0 - 0.5 * slope)).abs() < 1e-12);
    assert!((found.predicted(2) - 1.0).abs() < 1e-12 && (found.predicted(5) - 4.0).abs() < 1e-12);
    // Residuals of +-(1 - slope / 2) and +-slope / 2; each stratum's weight is 3 (3 - 2) / 2. The slope takes
    // 1/17 of two degrees of freedom; the rest is rounded down to one.
    let squares = 2.0 * ((1.0 - 0.5 * slope) * (1.0 - 0.5 * slope) + 0.25 * slope * slope);
    let variance = 1.5 * squares * 2.0 / (2.0 - 1.0 / 17.0);
    let total = found.total(0.95);
    assert!((total.high - total.value - 12.706_204_7 * variance.sqrt()).abs() < 1e-5, "{total:?}");
}

/// The ratio to a strictly proportional quantity is exact, however uncertain both are.
#[test]
fn a_fixed_ratio_is_certain() {
    let (x, time) = animation(ANIMATIONS[0].1, 3, 300);
    let (design, below) = estimate(&x, &time, 10, 5);
    let above = Estimate::new(&design, &x, |unit| 2.5 * time[unit]);
    let ratio = above.ratio(&below, 0.95);
    assert!((ratio.value - 2.5).abs() < 1e-12 && ratio.relative() < 1e-9, "{ratio:?}");
    assert!(below.total(0.95).relative() > 1e-4);
}

#[test]
fn a_linear_relation_is_estimated_exactly() {
    let x: Vec<f64> = (0..50).map(|k| f64::from(k * k)).collect();
    let y: Vec<f64> = x.iter().map(|x| 7.0 + 3.0 * x).collect();
    let total = estimate(&x, &y, 6, 1).1.total(0.95);
    assert!((total.value / y.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(total.relative() < 1e-9);
}

#[test]
fn doubling_the_representatives_keeps_the_first_ones() {
    let x: Vec<f64> = (0..300).map(|k| unit(5, k)).collect();
    let chosen = |count| Design::draw(&x, Some(150), count, |unit| word(9, unit)).chosen();
    for count in [7, 13, 25, 49] {
        let (few, many) = (chosen(count), chosen(2 * count - 1));
        assert_eq!([few.len(), many.len()], [count, 2 * count - 1]);
        assert!(few.iter().all(|unit| many.contains(unit)));
    }
}

proptest! {
    /// Replacing predictions by measured values keeps the total; every unit is in one stratum; simulating all
    /// units gives an interval of width 0.
    #[test]
    fn totals_and_strata_are_consistent(n in 1_usize..60, count in 0_usize..70, seed in 0_u64..1000, certain in prop::bool::ANY) {
        let x: Vec<f64> = (0..n as u64).map(|k| (unit(seed, k) * 8.0).floor()).collect();
        let y: Vec<f64> = (0..n as u64).map(|k| 10.0 + unit(seed + 1, k)).collect();
        let design = Design::draw(&x, certain.then_some(n / 2), count, |unit| word(seed, unit));
        let found = Estimate::new(&design, &x, |unit| y[unit]);
        let chosen = design.chosen();
        prop_assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]));
        prop_assert!(!certain || chosen.contains(&(n / 2)));
        let mut members: Vec<usize> = design.strata().iter().flat_map(|s| s.members.clone()).collect();
        members.sort_unstable();
        prop_assert_eq!(members, (0..n).collect::<Vec<_>>());
        prop_assert!((0..n).all(|unit| design.strata()[design.stratum_of(unit)].members.contains(&unit)));
        let mixed: f64 = (0..n).map(|k| if chosen.contains(&k) { y[k] } else { found.predicted(k) }).sum();
        let total = found.total(0.95);
        prop_assert!((mixed - total.value).abs() < 1e-9 * mixed);
        prop_assert!(total.low <= total.value && total.value <= total.high);
        if chosen.len() == n {
            prop_assert!((total.value - y.iter().sum::<f64>()).abs() < 1e-9 && total.relative() == 0.0);
        }
    }
}
