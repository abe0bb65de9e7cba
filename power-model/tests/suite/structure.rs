//! Costs of memories by size against runs of CACTI, and the numbers of structures.

use activity::{Event, Unit};
use power_model::{
    Bound, Charge, INTERPOLATION, Memory, MemoryCost, PowerModel, Scaling, Sram, SramRun, Structure,
    UncertainValue,
};

use super::common::{reference, table};

/// Leaves each run but the first and last of its curve out and finds it from the others: none is beyond the
/// stated interval.
#[test]
fn a_run_that_is_left_out_lies_within_the_stated_interval() {
    let runs = SramRun::all();
    for cost in MemoryCost::ALL {
        let mut errors: Vec<f64> = Vec::new();
        for (at, left) in runs.iter().enumerate() {
            let others: Vec<SramRun> =
                runs.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, run)| *run).collect();
            let of_kind = |run: &&SramRun| (run.fast, run.node_nm) == (left.fast, left.node_nm);
            let sizes = others.iter().filter(of_kind).map(|run| run.bytes);
            let (least, most) = sizes.fold((f64::MAX, 0.0_f64), |(a, b), size| (a.min(size), b.max(size)));
            if !(least..=most).contains(&left.bytes) {
                continue;
            }
            let all = Sram::of(&others);
            let found =
                all.iter().find(|sram| (sram.fast, sram.node_nm) == (left.fast, left.node_nm)).unwrap();
            let ratio = found.cost(cost, left.bytes) / left.costs[cost as usize];
            errors.push(ratio.max(1.0 / ratio));
        }
        errors.sort_by(f64::total_cmp);
        let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
        println!("{cost:?}: {} runs left out, median x{median:.3}, worst x{worst:.3}", errors.len());
        assert_eq!(errors.len(), 90);
        assert!(worst < INTERPOLATION && median < 1.2, "{cost:?}: {worst}");
    }
}

/// Costs follow the rows of the file, from 16 KB to 4 MB at 28 nm.
#[test]
fn a_cache_of_4_mb_costs_what_cacti_says_beside_one_of_16_kb() {
    let all = Sram::all();
    let fast = all.iter().find(|sram| sram.fast && sram.node_nm == 28).unwrap();
    let ratio = |cost: MemoryCost| fast.cost(cost, 4_194_304.0) / fast.cost(cost, 16_384.0);
    assert!((ratio(MemoryCost::ReadPj) - (328.84 / 64.0) / (5.25 / 32.0)).abs() < 1e-9);
    assert!((ratio(MemoryCost::LeakageMw) - 842.823 / 4.12966).abs() < 1e-9);
    assert!((ratio(MemoryCost::AreaMm2) - 6.0703 / 0.0208158).abs() < 1e-9);
}

/// One cache of `bytes` with some logic beside it.
fn structure(bytes: f64, madds: f64) -> Structure {
    let memory = Memory {
        name: "cache",
        unit: Unit::Texture,
        bytes,
        width_bytes: 64.0,
        accesses: 1.0,
        copies: 1.0,
        charges: vec![Charge::access(Event::TextureLines)],
    };
    let mut all = [0.0; Unit::COUNT];
    all[Unit::Texture as usize] = madds;
    Structure { memories: vec![memory], madds: all, clocks_hz: [1e9; Unit::COUNT], channels: 1.0 }
}

#[test]
fn an_access_of_a_larger_memory_costs_as_much_more_as_in_cacti() {
    let (home, own) = (structure(16_384.0, 1.0), structure(4_194_304.0, 1.0));
    let scaling = Scaling::new(&own, &home, &home, 28);
    let lines = scaling.event(Event::TextureLines);
    assert!((lines.nominal - (328.84 / 64.0) / (5.25 / 32.0)).abs() < 1e-9, "{lines:?}");
    assert!(lines.low < lines.nominal && lines.nominal <= lines.high);
    let [plain, scaled] = [Scaling::default(), scaling]
        .map(|scaling| PowerModel::on(&table(), &reference(), Bound::Nominal, &scaling).unwrap());
    let ratio = scaled.event_j(Event::TextureLines) / plain.event_j(Event::TextureLines);
    assert!((ratio - lines.nominal).abs() < 1e-12);
    assert_eq!(scaled.event_j(Event::DepthLines), plain.event_j(Event::DepthLines));
}

#[test]
fn logic_alone_scales_leakage_clock_and_area_in_proportion() {
    let (home, own) = (structure(0.0, 10.0), structure(0.0, 640.0));
    let scaling = Scaling::new(&own, &home, &home, 28);
    for ratio in [scaling.leakage, scaling.clock_tree(Unit::Texture)] {
        assert!((ratio.low - 64.0).abs() < 1e-9 && (ratio.high - 64.0).abs() < 1e-9, "{ratio:?}");
    }
    let [few, many] = [home, own].map(|structure| structure.area_mm2(28));
    assert!((many.nominal / few.nominal - 64.0).abs() < 1e-9);
    // 13,330 um2 at 40 nm.
    assert!((few.nominal - 10.0 * 13_330e-6 * 0.49).abs() < 1e-12, "{few:?}");
}

#[test]
fn area_follows_the_square_of_the_node() {
    let structure = structure(65_536.0, 100.0);
    let [at_28, at_14] = [28, 14].map(|node_nm| structure.area_mm2(node_nm));
    assert!((1.5..6.0).contains(&(at_28.nominal / at_14.nominal)), "{at_28:?} {at_14:?}");
    assert!(at_28.low <= at_28.nominal && at_28.nominal <= at_28.high);
}

#[test]
fn equal_structures_have_ratios_of_one() {
    let home = structure(16_384.0, 3.0);
    assert_eq!(Scaling::new(&home.clone(), &home, &home, 28), Scaling::default());
    assert_eq!(Scaling::default().farthest().0, 1.0);
    assert_eq!(Scaling::default().event(Event::L2Reads), UncertainValue::ONE);
}

/// Watts of files have a range; those computed from a machine that nobody could build do not, so that it is
/// warned of, not refused.
#[test]
fn a_machine_beyond_all_watts_is_still_a_machine() {
    let (home, own) = (structure(0.0, 1.0), structure(0.0, 1e12));
    let scaling = Scaling::new(&own, &home, &home, 28);
    let model = PowerModel::on(&table(), &reference(), Bound::Nominal, &scaling).unwrap();
    assert!(model.leakage_w() > 1e10 && model.leakage_w().is_finite());
}
