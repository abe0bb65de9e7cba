//! Programs of groups on what raster passes drew, against plain loops and closed forms.

use activity::{Event, Packet, PacketKind, Waits};
use glam::{DVec3, Vec3, Vec4};
use pipeline::{Camera, ComputeSpec, Format, Gpu, Lane, PipelineSpec, SurfaceId, SurfaceSpec, SurfaceView};
use workloads::compute::{
    Atomics, Compute, ComputeOptions, Kernel, Kernels, LightSphere, Order, TileLights, bin,
};
use workloads::job::{DrawsScene, Job, JobRequest, OptionSource};
use workloads::scene::{Frame, Overrides};

use crate::common::{drawn_on, hardware, spec};

const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

fn job(options: &ComputeOptions, size: (u32, u32), samples: u32) -> Compute {
    let overrides = Overrides { size: Some(size), samples: Some(samples), ..Overrides::default() };
    Compute::new(options.clone(), &overrides, 3).unwrap()
}

fn first_frame(job: &Compute) -> Frame {
    DrawsScene::scene(job).frame(0).unwrap()
}

/// Luminances of the samples of a stored image, pixel by pixel.
fn luminances(contents: &[Vec4]) -> Vec<f32> {
    contents.iter().map(|color| color.truncate().dot(LUMINANCE)).collect()
}

fn pairs(order: Order, values: &mut [f32]) {
    let size = values.len();
    let mut distance = if order == Order::Sequential { size / 2 } else { 1 };
    while (1..size).contains(&distance) {
        let firsts: Vec<usize> = match order {
            Order::Sequential => (0..distance).collect(),
            Order::Interleaved => (0..size).step_by(2 * distance).collect(),
        };
        firsts.into_iter().for_each(|first| values[first] += values[first + distance]);
        distance = if order == Order::Sequential { distance / 2 } else { 2 * distance };
    }
}

/// The mean by plain loops, in the order in which groups add.
fn mean(luminances: &[f32], [width, height]: [u32; 2], samples: u32, options: &ComputeOptions) -> f32 {
    let (columns, rows) = (16, options.group / 16 * options.per_lane);
    let mut sums = Vec::new();
    for (top, left) in (0..height)
        .step_by(rows as usize)
        .flat_map(|top| (0..width).step_by(columns as usize).map(move |left| (top, left)))
    {
        let mut lanes = vec![0.0; options.group as usize];
        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            if left + x < width && top + y < height {
                let pixel = ((top + y) * width + left + x) * samples;
                let lane = &mut lanes[((y * columns + x) % options.group) as usize];
                (pixel..pixel + samples).for_each(|sample| *lane += luminances[sample as usize]);
            }
        }
        pairs(options.order, &mut lanes);
        sums.push(lanes[0]);
    }
    let mut lanes = vec![0.0; options.group as usize];
    sums.iter().enumerate().for_each(|(number, sum)| lanes[number % options.group as usize] += sum);
    pairs(options.order, &mut lanes);
    lanes[0] * (1.0 / (width * height * samples) as f32)
}

/// A kernel on the image of the first frame, and what is stored of it.
fn on_image<T>(
    job: &Compute,
    options: &ComputeOptions,
    run: impl Fn(&mut Kernels<'_, '_>, &SurfaceView) -> T,
) -> (T, Vec<f32>) {
    let (spec, frame) = (hardware(), first_frame(job));
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let image = job.image(&frame, None, &mut gpu).unwrap();
    let luminances = luminances(&gpu.contents(image).unwrap());
    let view = gpu.surface_view(image).unwrap();
    (run(&mut Kernels::new(&mut gpu, options).unwrap(), &view), luminances)
}

#[test]
fn a_reduction_is_the_mean_of_plain_loops_bit_for_bit() {
    for (order, samples, group, per_lane) in [
        (Order::Sequential, 1, 128, 4),
        (Order::Interleaved, 1, 64, 1),
        (Order::Sequential, 4, 256, 3),
        (Order::Interleaved, 3, 16, 64),
    ] {
        let options = ComputeOptions { order, group, per_lane, ..ComputeOptions::default() };
        let job = job(&options, (100, 37), samples);
        let run = |options: &ComputeOptions| {
            on_image(&job, options, |kernels, image| {
                let mean = kernels.mean_luminance(image).unwrap();
                kernels.values(mean)[0]
            })
        };
        let (found, luminances) = run(&options);
        assert_eq!(found.to_bits(), mean(&luminances, [100, 37], samples, &options).to_bits());
        let exact = luminances.iter().copied().map(f64::from).sum::<f64>() / luminances.len() as f64;
        assert!((f64::from(found) / exact - 1.0).abs() < 1e-5 && exact > 0.01, "{found} {exact}");
        // Where partial sums lie makes no difference.
        for (stride, padded) in [(2, false), (7, true)] {
            assert_eq!(run(&ComputeOptions { stride, padded, ..options.clone() }).0, found);
        }
    }
}

#[test]
fn the_mean_of_one_grey_is_the_grey() {
    let options = ComputeOptions { contrast: 0.0, per_lane: 2, ..ComputeOptions::default() };
    let (found, luminances) = on_image(&job(&options, (64, 32), 1), &options, |kernels, image| {
        let mean = kernels.mean_luminance(image).unwrap();
        kernels.values(mean)[0]
    });
    // Sums of equal numbers, as many as a power of two, are exact.
    let grey = Vec3::splat(Format::Rgba16f.round(Vec4::splat(0.18)).x).dot(LUMINANCE);
    assert_eq!((found, luminances), (grey, vec![grey; 64 * 32]));
}

/// A chain keeps halves and leaves out the last row or column of odd sizes.
#[test]
fn the_mean_of_a_mip_chain_is_that_of_its_pixels() {
    let options = ComputeOptions { kernel: Kernel::MipChain, ..ComputeOptions::default() };
    let error = |size: (u32, u32), samples: u32| {
        let (spec, job) = (hardware(), job(&options, size, samples));
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let chain = job.chain(&first_frame(&job), &mut gpu).unwrap();
        let pixels = luminances(&gpu.contents(chain.pixels).unwrap());
        assert_eq!(pixels.len() as u32, size.0 * size.1);
        let names: Vec<String> = gpu.finish().passes.into_iter().map(|pass| pass.name).collect();
        assert_eq!(names.iter().filter(|name| *name == "resolve").count(), usize::from(samples > 1));
        let exact = pixels.iter().copied().map(f64::from).sum::<f64>() / pixels.len() as f64;
        (f64::from(chain.mean) / exact - 1.0).abs()
    };
    for samples in [1, 4] {
        // Six levels of halves, each with an error of half a step.
        assert!(error((64, 32), samples) < 6.0 * 2.0_f64.powi(-11));
        assert!(error((127, 31), samples) > 6.0 * 2.0_f64.powi(-11), "odd sizes");
    }
}

#[test]
fn a_mip_chain_exposes_as_the_reduction_does() {
    let image = |kernel| packets(&ComputeOptions { kernel, ..ComputeOptions::default() }, 2).1;
    let [chain, reduction] = [Kernel::MipChain, Kernel::Reduction].map(image);
    let most = chain.iter().zip(&reduction).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    assert!(most < 0.05 && chain != vec![chain[0]; chain.len()], "{most}");
}

#[test]
fn bank_conflicts_are_those_of_the_layout() {
    let conflicts = |order, stride, padded| {
        let options =
            ComputeOptions { order, stride, padded, group: 128, per_lane: 1, ..ComputeOptions::default() };
        let (counts, _) = on_image(&job(&options, (16, 8), 1), &options, |kernels, image| {
            kernels.mean_luminance(image).unwrap();
            *kernels.counts()
        });
        counts[Event::BankConflicts]
    };
    assert_eq!(conflicts(Order::Sequential, 1, false), 0);
    assert_eq!(conflicts(Order::Sequential, 33, false), 0, "an odd stride");
    // All lanes of a warp ask one bank, in one group of 128 pixels and in that of the mean: four warps store;
    // then two loads and a store by 64, 32, ..., 1 lanes.
    let in_line = 4 * 31 + 3 * (2 * 31 + 31 + 15 + 7 + 3 + 1);
    assert_eq!(conflicts(Order::Sequential, 32, false), 2 * in_line);
    assert_eq!(conflicts(Order::Sequential, 32, true), 0);
    // Lanes are 2, 4, ..., 128 words apart, twice that many for the first load: by hand, for 64, 32, ...
    // lanes in warps of 32, of which min(32, distance) or all that are left ask a bank.
    let of_step =
        |lanes: u64, apart: u64| lanes.div_ceil(32) * (lanes.min(32).div_ceil(32 / apart.min(32)) - 1);
    let interleaved: u64 = (0..7).map(|step| 3 * of_step(64 >> step, 2 << step)).sum();
    assert_eq!(conflicts(Order::Interleaved, 1, false), 2 * interleaved);
    assert!(conflicts(Order::Interleaved, 1, true) < interleaved / 4);
}

#[test]
fn a_histogram_counts_every_value() {
    for (atomics, bins, copies, padded, samples) in [
        (Atomics::Shared, 256, 1, false, 1),
        (Atomics::Shared, 64, 8, true, 2),
        (Atomics::Global, 256, 1, false, 1),
    ] {
        let options = ComputeOptions { atomics, bins, copies, padded, ..ComputeOptions::default() };
        let ((counts, sums), luminances) =
            on_image(&job(&options, (100, 37), samples), &options, |kernels, image| {
                let counts = kernels.histogram(image).unwrap();
                let sums = kernels.sums(counts).unwrap();
                (kernels.values(counts), kernels.values(sums))
            });
        let mut expected = vec![0_u32; bins as usize];
        luminances.iter().for_each(|&l| expected[bin(&Lane::default(), l, bins) as usize] += 1);
        assert_eq!(counts, expected);
        assert!(counts.iter().filter(|count| **count > 0).count() > 8, "{counts:?}");
        let running = expected.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        });
        assert_eq!(sums, running.collect::<Vec<u32>>());
    }
}

#[test]
fn bins_are_even_in_the_logarithm() {
    let bins = [0.0, 1e-9, 1.0 / 256.0, 0.25, 1.0, 3.99, 4.0, 1e9].map(|l| bin(&Lane::default(), l, 160));
    assert_eq!(bins, [0, 0, 0, 96, 128, 159, 159, 159]);
}

#[test]
fn lanes_on_one_bin_wait_in_line() {
    let in_line = |atomics, copies, padded| {
        let options = ComputeOptions { atomics, copies, padded, contrast: 0.0, ..ComputeOptions::default() };
        let (counts, _) = on_image(&job(&options, (128, 64), 1), &options, |kernels, image| {
            kernels.histogram(image).unwrap();
            (*kernels.counts(), kernels.cycles_per_shared_access(), kernels.atomics_per_word())
        });
        counts
    };
    let warps = 128 * 64 / 32;
    let (counts, _, per_word) = in_line(Atomics::Global, 1, false);
    assert_eq!((counts[Event::AtomicConflicts], per_word), (31 * warps, 32.0));
    let (counts, ..) = in_line(Atomics::Shared, 1, false);
    assert_eq!(counts[Event::BankConflicts], 31 * warps);
    // Copies of a bin are in one bank, unless they are padded.
    assert_eq!(in_line(Atomics::Shared, 8, false).0[Event::BankConflicts], 31 * warps);
    assert_eq!(in_line(Atomics::Shared, 8, true).0[Event::BankConflicts], 3 * warps);
}

/// Lists by plain loops over tiles and lights, in single precision.
fn listed(
    depths: &[Vec4],
    samples: u32,
    camera: &Camera,
    [width, height]: [u32; 2],
    lights: &[LightSphere],
    options: &ComputeOptions,
) -> Vec<Vec<u32>> {
    let scale = 0.5 * height as f32 / camera.half_height();
    let side = options.tile_px;
    let tile = |top: u32, left: u32| {
        let (bottom, right) = ((top + side).min(height), (left + side).min(width));
        let inside = |y: u32| {
            (left..right).flat_map(move |x| (0..samples).map(move |s| (y * width + x) * samples + s))
        };
        let seen: Vec<f32> = (top..bottom)
            .flat_map(inside)
            .map(|at| depths[at as usize].x)
            .filter(|d| d.is_finite())
            .collect();
        let [near, far] = if options.depth_bounds {
            [seen.iter().copied().fold(f32::INFINITY, f32::min), seen.iter().copied().fold(0.0, f32::max)]
        } else {
            [0.0, f32::INFINITY]
        };
        let beyond = |px: u32, middle: f32, along: f32, depth: f32| {
            let slope = middle - px as f32;
            (slope * depth + scale * along) * (1.0 / (slope * slope + scale * scale).sqrt())
        };
        let reaches = |light: &LightSphere| {
            let at = camera.open().transform_point3(light.centre);
            let [x, y] = [0.5 * width as f32, 0.5 * height as f32];
            let sides = [
                -beyond(left, x, at.x, at.z),
                beyond(right, x, at.x, at.z),
                -beyond(top, y, -at.y, at.z),
                beyond(bottom, y, -at.y, at.z),
            ];
            near - at.z <= light.radius
                && at.z - far <= light.radius
                && sides.iter().all(|side| *side <= light.radius)
        };
        (0..).zip(lights).filter(|(_, light)| reaches(light)).map(|(number, _)| number).collect()
    };
    let tops = (0..height).step_by(side as usize);
    tops.flat_map(|top| (0..width).step_by(side as usize).map(move |left| (top, left)))
        .map(|(top, left)| tile(top, left))
        .collect()
}

struct Culled {
    frame: Frame,
    depths: Vec<Vec4>,
    lights: Vec<LightSphere>,
    tiles: TileLights,
}

fn culled(options: &ComputeOptions, size: (u32, u32), samples: u32) -> Culled {
    let (job, spec) = (job(options, size, samples), hardware());
    let (frame, mut gpu) = (first_frame(&job), Gpu::without_packets(&spec).unwrap());
    let depth = job.depths(&frame, &mut gpu).unwrap();
    let (depths, view) = (gpu.contents(depth).unwrap(), gpu.surface_view(depth).unwrap());
    let lights = job.lights(&frame).unwrap();
    let mut kernels = Kernels::new(&mut gpu, options).unwrap();
    let tiles = kernels.light_lists(&view, (&frame.camera, job.viewport().unwrap()), &lights).unwrap();
    Culled { frame, depths, lights, tiles }
}

#[test]
fn lists_of_tiles_are_those_of_plain_loops() {
    for (tile_px, depth_bounds, samples, group) in [(16, true, 1, 128), (8, true, 3, 64), (32, false, 1, 256)]
    {
        let options = ComputeOptions { tile_px, depth_bounds, group, list: 512, ..ComputeOptions::default() };
        let Culled { frame, depths, lights, tiles } = culled(&options, (100, 60), samples);
        let expected = listed(&depths, samples, &frame.camera, [100, 60], &lights, &options);
        let sorted = |mut list: Vec<u32>| {
            list.sort_unstable();
            list
        };
        let found: Vec<Vec<u32>> = tiles.lists.into_iter().map(sorted).collect();
        assert_eq!(found, expected);
        assert!(expected.iter().any(|list| list.len() > 3) && expected.iter().any(|list| list.len() < 64));
        // Of a list that is too short the count is still right.
        let short = culled(&ComputeOptions { list: 2, ..options }, (100, 60), samples).tiles;
        assert_eq!(short.counts, expected.iter().map(|list| list.len() as u32).collect::<Vec<_>>());
        assert!(short.lists.iter().all(|list| list.len() <= 2));
    }
}

/// A light that reaches a point of the image is in the list of its tile.
#[test]
fn no_light_is_lost() {
    let options = ComputeOptions { list: 512, ..ComputeOptions::default() };
    let Culled { frame, depths, lights, tiles } = culled(&options, (96, 54), 1);
    let pose = frame.camera.open().inverse();
    let tangent = f64::from(frame.camera.half_height());
    let mut reached = 0;
    for (pixel, depth) in (0..).zip(&depths).filter(|(_, depth)| depth.x.is_finite()) {
        let [x, y] = [pixel % 96, pixel / 96];
        let list = &tiles.lists[(y / 16 * 6 + x / 16) as usize];
        // A pixel's sample is anywhere in it; lights that reach all of its corners reach the sample.
        let corner = |[dx, dy]: [f64; 2]| {
            let at =
                [(f64::from(x) + dx - 48.0) / 27.0 * tangent, (27.0 - f64::from(y) - dy) / 27.0 * tangent];
            let point = DVec3::new(at[0], at[1], 1.0) * f64::from(depth.x);
            pose.transform_point3(point.as_vec3()).as_dvec3()
        };
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(corner);
        for (number, light) in (0..).zip(&lights) {
            let radius = f64::from(light.radius) * (1.0 - 1e-5);
            if corners.iter().all(|corner| corner.distance(light.centre.as_dvec3()) < radius) {
                reached += 1;
                assert!(list.contains(&number), "light {number} at pixel {x}, {y}");
            }
        }
    }
    assert!(reached > 1000, "{reached}");
}

/// Packets and image of a frame.
fn packets(options: &ComputeOptions, threads: usize) -> (Vec<Packet>, Vec<Vec3>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (spec, mut packets) = (hardware(), Vec::new());
        let mut gpu = Gpu::new(&spec, |packet, _| packets.push(*packet)).unwrap();
        let drawn = job(options, (96, 54), 1).frame(0, &mut gpu).unwrap();
        gpu.finish();
        (packets, drawn.image)
    })
}

#[test]
fn groups_wait_for_what_they_read_and_results_are_the_same_for_any_threads() {
    for kernel in [Kernel::Reduction, Kernel::Histogram, Kernel::LightCulling] {
        let options = ComputeOptions { kernel, ..ComputeOptions::default() };
        let (packets_of_one, image) = packets(&options, 1);
        assert!(packets(&options, 3) == (packets_of_one.clone(), image.clone()), "{kernel:?}");
        let waiting: Vec<u32> = packets_of_one
            .iter()
            .filter(|packet| packet.kind == PacketKind::Barrier(Waits::Tiles))
            .map(|packet| packet.pass)
            .collect();
        // Every pass but the first reads what the one before wrote.
        assert_eq!(waiting, [1, 2, 3]);
        let distinct = image.iter().filter(|color| **color != image[0]).count();
        assert!(distinct > 200, "{kernel:?}: {distinct}");
    }
}

#[test]
fn weak_regimes_have_warnings_and_others_none() {
    let codes = |options: ComputeOptions| -> Vec<&'static str> {
        let (drawn, ..) = drawn_on(&hardware(), &job(&options, (96, 54), 1), 0);
        drawn.warnings.iter().map(|warning| warning.code.name()).collect()
    };
    let reduction = ComputeOptions { kernel: Kernel::Reduction, ..ComputeOptions::default() };
    assert_eq!(codes(ComputeOptions { stride: 32, ..reduction.clone() }), ["bank-conflicts"]);
    assert!(codes(reduction).is_empty());
    let histogram = ComputeOptions { kernel: Kernel::Histogram, ..ComputeOptions::default() };
    for atomics in [Atomics::Shared, Atomics::Global] {
        assert_eq!(
            codes(ComputeOptions { atomics, contrast: 0.0, ..histogram.clone() }),
            ["atomic-contention"]
        );
    }
    // Copies of a bin are in one bank, unless they are padded.
    let flat = ComputeOptions { copies: 8, contrast: 0.0, ..histogram };
    assert_eq!(codes(flat.clone()), ["atomic-contention"]);
    assert!(codes(ComputeOptions { padded: true, ..flat }).is_empty());
    assert_eq!(codes(ComputeOptions { list: 1, ..ComputeOptions::default() }), ["light-lists-full"]);
    assert!(codes(ComputeOptions { list: 512, ..ComputeOptions::default() }).is_empty());
}

/// As `hd_4000` and `iris_pro` have them: the message says which option fits, and it does.
#[test]
fn groups_that_are_too_large_are_refused_with_what_fits() {
    let whole = hardware().compute.unwrap();
    let compute = Some(ComputeSpec { group_lanes: 128, shared_bytes: 4096, ..whole });
    let small = PipelineSpec { compute, ..spec() };
    let drawn = |options: ComputeOptions| {
        let job = job(&options, (40, 24), 1);
        Job::frame(&job, 0, &mut Gpu::without_packets(&small).unwrap()).map_err(|error| error.to_string())
    };
    let histogram = ComputeOptions { kernel: Kernel::Histogram, ..ComputeOptions::default() };
    let error = drawn(histogram.clone()).err().unwrap();
    assert!(error.contains("bins 256") && error.contains("`--set bins=128`"), "{error}");
    assert!(drawn(ComputeOptions { bins: 128, ..histogram.clone() }).is_ok());
    let error = drawn(ComputeOptions { group: 512, bins: 64, ..histogram }).err().unwrap();
    assert!(error.contains("`--set group=128`"), "{error}");
}

#[test]
fn a_gpu_without_compute_unit_is_refused_with_a_remedy() {
    let job = job(&ComputeOptions::default(), (32, 32), 1);
    let without = spec();
    let error = Job::frame(&job, 0, &mut Gpu::without_packets(&without).unwrap()).unwrap_err().to_string();
    assert!(error.contains("no compute unit; choose one with `compute` in its file"), "{error}");
}

#[test]
fn options_are_checked() {
    for (name, value, says) in [
        ("group", "100", "a power of two, 16 to 1024"),
        ("tile_px", "128", "a power of two, 4 to 64"),
        ("contrast", "1.5", "0 to 1"),
        ("kernel", "blur", "unknown value `blur`"),
    ] {
        let source = OptionSource { file: None, set: vec![(name.to_owned(), value.to_owned())] };
        let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
        let error = workloads::compute::job(&source, &request).err().unwrap().to_string();
        assert!(error.contains(name) && error.contains(says), "{error}");
    }
}

#[test]
fn an_unwritten_surface_has_no_view() {
    let spec = hardware();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let job = job(&ComputeOptions::default(), (32, 32), 1);
    let depth: SurfaceId = job.depths(&first_frame(&job), &mut gpu).unwrap();
    assert!(gpu.surface_view(depth).is_some());
    let empty = SurfaceSpec::new("empty", job.viewport().unwrap(), Format::D32);
    let empty = gpu.create_surface(&empty);
    assert!(gpu.surface_view(empty).is_none());
}
