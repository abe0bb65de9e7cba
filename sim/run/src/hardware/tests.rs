//! More hardware costs more, and the GPU of a platform keeps its numbers.

use power_model::{Bound, EnergyTable, Estimate, PowerModel};
use proptest::prelude::*;

use super::*;

/// Numbers of a GPU file that add hardware where they grow: path from `gpu`, and where drawing starts.
pub(crate) const GROW: [(&str, f64); 40] = [
    ("pipeline.vertex_reuse", 32.0),
    ("pipeline.shading_cache.entries", 1024.0),
    ("pipeline.memory.depth.entries", 256.0),
    ("pipeline.memory.colour.entries", 256.0),
    ("pipeline.memory.texture.entries", 256.0),
    ("pipeline.memory.bins.entries", 512.0),
    ("pipeline.memory.l2.entries", 4096.0),
    ("pipeline.compute.banks", 2.0),
    ("pipeline.compute.atomic_units", 1.0),
    ("units.command.queue", 16.0),
    ("units.command.in_flight", 16.0),
    ("units.command.rates.indices", 1.0),
    ("units.command.rates.vertices_fetched", 1.0),
    ("units.shader.queue", 32.0),
    ("units.shader.in_flight", 32.0),
    ("units.shader.cores", 2.0),
    ("units.shader.lanes", 32.0),
    ("units.shader.warps", 16.0),
    ("units.shader.shared_bytes", 16384.0),
    ("units.setup.rates.triangles_in", 0.25),
    ("units.traversal.rates.tile_madds", 48.0),
    ("units.traversal.rates.tiles_visited", 1.0),
    ("units.traversal.rates.coarse_tiles_visited", 1.0),
    ("units.z_cull.rates.z_cull_tests", 1.0),
    ("units.z_cull.rates.depth_interval_madds", 8.0),
    ("units.sample_test.rates.screen_madds", 480.0),
    ("units.sample_test.rates.sample_madds", 432.0),
    ("units.sample_test.rates.samples_tested", 24.0),
    ("units.depth.rates.depth_lines", 1.0),
    ("units.depth.rates.depth_reads", 16.0),
    ("units.shading_cache.rates.shading_lookups", 16.0),
    ("units.shading_cache.rates.quads_shaded", 1.0),
    ("units.texture.rates.texture_fetches", 4.0),
    ("units.texture.rates.texture_lines", 2.0),
    ("units.colour.rates.colour_writes", 16.0),
    ("units.colour.rates.colour_lines", 1.0),
    ("units.compute.rates.shared_cycles", 2.0),
    ("units.compute.rates.buffer_lines", 1.0),
    ("units.l2.lines_per_cycle", 1.0),
    ("units.dram.channels", 2.0),
];

/// Changes of values in the GPU file.
pub(crate) fn set(values: &[(&str, f64)]) -> Vec<crate::Change> {
    let change = |&(path, value): &(&str, f64)| crate::Change {
        path: format!("gpu.{path}"),
        value: format!("{value}"),
    };
    values.iter().map(change).collect()
}

/// The GPU `name` with changes.
fn changed(name: &str, values: &[(&str, f64)]) -> GpuSpec {
    let changes = set(values);
    let mut changes = crate::changes::Changes::new(&changes).unwrap();
    changes.gpu(name.as_ref()).unwrap().unwrap()
}

/// Area, leakage, idle power and the watts of each unit, which must not fall.
fn costs(gpu: &GpuSpec, platform: &Platform, bound: Bound) -> Vec<(String, f64)> {
    let scaling = scaling(gpu, platform).unwrap();
    let on = platform.on(&scaling, bound);
    let area = structure(gpu).area_mm2(platform.node_nm).at(bound);
    let mut costs = vec![
        ("area".to_owned(), area),
        ("leakage".to_owned(), on.leakage_w()),
        ("idle".to_owned(), on.idle_w.value()),
    ];
    for row in on.units() {
        costs.push((format!("{} busy", row.unit.name()), row.clock_tree_w.value()));
        costs.push((format!("{} idle", row.unit.name()), row.idle_unit_w.value()));
    }
    costs
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// From a machine drawn at random, none of its numbers that adds hardware lowers area, leakage or idle power.
    #[test]
    fn no_number_that_adds_hardware_makes_anything_cheaper(
        start in prop::collection::vec(0..3_u32, GROW.len()),
        which in 0..GROW.len(),
        by in 1..5_u32,
        bound in prop::sample::select(vec![Bound::Low, Bound::Nominal, Bound::High]),
    ) {
        let at = |index: usize, doublings: u32| (GROW[index].0, GROW[index].1 * f64::from(1 << doublings));
        let few: Vec<_> = (0..GROW.len()).map(|index| at(index, start[index])).collect();
        let mut more = few.clone();
        more[which] = at(which, start[which] + by);
        let platform = Platform::builtin("reference").unwrap();
        let [few, more] = [few, more].map(|changes| costs(&changed("reference", &changes), &platform, bound));
        for ((what, few), (_, more)) in few.iter().zip(&more) {
            prop_assert!(more >= &(few * (1.0 - 1e-12)), "{} by {}: {} from {} to {}", GROW[which].0, by, what, few, more);
        }
    }
}

#[test]
fn every_number_that_adds_hardware_is_paid_for() {
    let platform = Platform::builtin("reference").unwrap();
    let home = costs(&GpuSpec::load("reference").unwrap(), &platform, Bound::Nominal);
    for (path, start) in GROW {
        let grown = changed("reference", &[(path, 32.0 * start)]);
        let grown = costs(&grown, &platform, Bound::Nominal);
        let dearer = home.iter().zip(&grown).filter(|((_, few), (_, more))| *more > 1.000_01 * few).count();
        assert!(dearer > 0, "{path} times 32 costs nothing");
    }
}

#[test]
fn the_gpu_of_a_platform_keeps_its_numbers_to_the_last_bit() {
    for name in Platform::names() {
        let platform = Platform::builtin(name).unwrap();
        let gpu = GpuSpec::load(&platform.made_for).unwrap();
        let scaling = scaling(&gpu, &platform).unwrap();
        let table = EnergyTable::builtin("28nm").unwrap();
        for bound in [Bound::Low, Bound::Nominal, Bound::High] {
            assert_eq!(platform.on(&scaling, bound), platform.at(bound), "{name}");
            let [plain, scaled] = [
                PowerModel::at(&table, &platform, bound),
                PowerModel::on(&table, &platform, bound, &scaling),
            ]
            .map(Result::unwrap);
            assert_eq!(plain, scaled, "{name}");
        }
    }
}

#[test]
fn what_is_the_same_in_another_gpu_costs_the_same() {
    let platform = Platform::builtin("reference").unwrap();
    let larger = changed("reference", &[("pipeline.memory.texture.entries", 4096.0)]);
    let scaling = scaling(&larger, &platform).unwrap();
    assert_eq!(scaling.event(Event::DepthLines), Estimate::ONE);
    assert_eq!(scaling.clock_tree(Unit::Depth), Estimate::ONE);
    let lines = scaling.event(Event::TextureLines);
    assert!(1.5 < lines.low && lines.low <= lines.nominal && lines.nominal <= lines.high, "{lines:?}");
    assert_eq!(lines, scaling.event(Event::TextureMisses));
}

#[test]
fn clock_trees_follow_the_clock_and_leakage_does_not() {
    let platform = Platform::builtin("reference").unwrap();
    let fast = changed("reference", &[("core_hz", 800e6)]);
    let scaling = scaling(&fast, &platform).unwrap();
    assert_eq!(scaling.leakage, Estimate::ONE);
    for unit in Unit::ALL.into_iter().filter(|unit| !unit.is_optional()) {
        let ratio = if unit == Unit::Dram { 1.0 } else { 2.0 };
        assert_eq!(scaling.clock_tree(unit).nominal, ratio, "{}", unit.name());
    }
}

/// Areas beside those of products: they have what is not modelled (interfaces, video, displays, wires), and not the 5D units.
#[test]
fn areas_are_below_those_of_products() {
    // Tahiti: 365 mm2 (HotHardware, HD 7970 review). Ivy Bridge: 160 mm2, 113 mm2 without graphics (AnandTech, i7 3770K review).
    for (name, node_nm, product_mm2) in [("discrete", 28, 365.0), ("hd_4000", 22, 47.0)] {
        let area = structure(&GpuSpec::load(name).unwrap()).area_mm2(node_nm);
        println!("{name}: {area:?}, product {product_mm2} mm2");
        assert!(area.nominal < product_mm2 && product_mm2 < 2.0 * area.high, "{name}: {area:?}");
    }
}

/// The reference platform, as if it was made for `gpu`.
fn made_for(gpu: &str) -> Platform {
    let mut platform = Platform::builtin("reference").unwrap();
    gpu.clone_into(&mut platform.made_for);
    platform
}

/// Levels below the L2, from those of a GPU that has them.
#[test]
fn larger_levels_below_the_l2_are_dearer() {
    let platform = made_for("iris_pro");
    let home = costs(&GpuSpec::load("iris_pro").unwrap(), &platform, Bound::Nominal);
    for (path, value) in [
        ("pipeline.memory.llc.entries", 393_216.0),
        ("pipeline.memory.edram.entries", 8_388_608.0),
        ("units.llc.lines_per_cycle", 8.0),
    ] {
        let grown = costs(&changed("iris_pro", &[(path, value)]), &platform, Bound::Nominal);
        assert!(home.iter().zip(&grown).all(|((_, few), (_, more))| more >= few), "{path}");
        let level = if path.contains("edram") { "edram idle" } else { "llc idle" };
        let watts = |costs: &[(String, f64)]| costs.iter().find(|(what, _)| what == level).unwrap().1;
        assert!(watts(&grown) > 1.5 * watts(&home), "{path}: {} W, {} W", watts(&home), watts(&grown));
    }
}

#[test]
fn a_platform_of_a_gpu_that_is_not_there_is_refused() {
    let platform = made_for("referense");
    let error = scaling(&GpuSpec::load("reference").unwrap(), &platform).unwrap_err().to_string();
    assert!(
        error.contains("`made_for` of platform `reference`") && error.contains("`reference`?"),
        "{error}"
    );
}
