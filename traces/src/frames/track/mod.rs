//! prototype
mod bank;
mod chain;
mod evidence;

pub(super) use bank::Bank;
use chain::{Chain, Graph};
use evidence::{Evidence, FEATURES};
use crate::frames::marks::Placement;
use crate::frames::minima::spaced_minima;
use crate::frames::regularity::regularity;
use crate::frames::split::otsu_tree;

/// What came out.
pub(super) struct Tracked {
    pub starts: Vec<Start>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub offset: usize,
    pub confidence: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub offset: usize,
    pub features: [f64; FEATURES],
}

pub(super) fn track(power: &[f64], placement: &Placement) -> Tracked {
    let debug = std::env::var("TRACK_DEBUG").is_ok();
    let knob = |name: &str, default: f64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
    let width = placement.samples;
    let mut bank = Bank::new(power, width);
    for mark in &placement.marks {
        bank.add(&power[mark.first..mark.first + width]);
    }
    let marks: Vec<usize> = placement.marks.iter().map(|mark| mark.first).collect();
    let spacing = (width / 8).max(2);
    // First guess: the more regular of the two measures at the usual spacing.
    let mut weights: Vec<f64>;
    let all = |offset: usize, reach: usize| marks.iter().any(|m| m.abs_diff(offset) <= reach);
    let (mut period, initial) = first_guess(&bank, width / 2, &marks, 200 * width);
    let mut reach = knob("REACH", 12.0) as usize * period;
    let within = |bank: &Bank, reach: usize| -> Vec<Candidate> {
        let mut candidates = collect(bank, spacing, &marks);
        candidates.retain(|c| all(c.offset, reach));
        candidates
    };
    let mut candidates = within(&bank, reach);
    if debug { eprintln!("period {period} of {} candidates, initial {}", candidates.len(), initial.len()); }
    let near = |offset: usize, set: &[usize]| {
        let at = set.partition_point(|&o| o < offset);
        set[at.saturating_sub(1)..(at + 1).min(set.len())].iter().any(|&o| o.abs_diff(offset) < spacing)
    };
    let mut chosen: Vec<bool> = candidates.iter().map(|c| near(c.offset, &initial)).collect();
    let mut evidence = Evidence::learn(&candidates, &chosen);
    let mut chain = Chain::default();
    let mut last = knob("LAST", 3.0) as usize;
    loop {
        candidates = within(&bank, reach);
        weights = evidence.weights(&candidates, &marks);
        prune(&mut candidates, &mut weights, period, knob("KEEP", 10.0) as usize, &marks);
        let graph = Graph::new(&bank, &candidates, &weights, period);
        chain = graph.best(&bank, knob("PAIR", 1.0), chain.pairing());
        let offsets: Vec<usize> = chain.nodes.iter().map(|&n| candidates[n].offset).collect();
        period = median_gap(&offsets).unwrap_or(period);
        if debug { eprintln!("reach {reach}: chain {} of {} period {period} score {:.1} evidence {:?}", chain.nodes.len(), candidates.len(), chain.score, evidence); }
        if reach >= power.len() {
            if last == 0 { break; }
            last -= 1;
        }
        let added = bank.learn(power, &candidates, &chain, knob("LEARN", 6.0) as usize);
        if debug { eprintln!("  added {added:?}"); }
        let known = within(&bank, reach);
        chosen = known.iter().map(|c| near(c.offset, &offsets)).collect();
        evidence = Evidence::learn(&known, &chosen);
        reach = (reach as f64 * knob("GROW", 2.0)) as usize;
    }
    let starts = chain.nodes.iter().map(|&n| Start { offset: candidates[n].offset, confidence: 1.0 }).collect();
    Tracked { starts }
}

fn median_gap(offsets: &[usize]) -> Option<usize> {
    let mut gaps: Vec<usize> = offsets.windows(2).map(|p| p[1] - p[0]).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 2).copied()
}

fn collect(bank: &Bank, spacing: usize, marks: &[usize]) -> Vec<Candidate> {
    let mut offsets = spaced_minima(&bank.shape, spacing);
    offsets.extend(spaced_minima(&bank.squares, spacing));
    offsets.retain(|o| marks.iter().all(|m| m.abs_diff(*o) >= spacing));
    offsets.extend(marks);
    offsets.sort_unstable();
    offsets.dedup_by(|b, a| *b - *a < 3);
    offsets.into_iter().map(|offset| Candidate { offset, features: bank.features(offset) }).collect()
}

/// Period and starts from one of the two measures.
fn first_guess(bank: &Bank, spacing: usize, marks: &[usize], reach: usize) -> (usize, Vec<usize>) {
    let mut best: (f64, usize, Vec<usize>) = (-1.0, spacing * 2, marks.to_vec());
    for profile in [&bank.shape, &bank.squares] {
        let mut minima = spaced_minima(profile, spacing);
        minima.retain(|o| marks.iter().any(|m| m.abs_diff(*o) <= reach));
        let usual = median_gap(&minima).unwrap_or(spacing);
        let mut logs: Vec<f64> = minima.iter().filter(|o| !marks.contains(o)).map(|&o| libm::log(profile[o].max(1e-12))).collect();
        logs.sort_by(f64::total_cmp);
        for split in otsu_tree(&logs, 3) {
            let threshold = libm::exp(0.5 * (logs[split.count - 1] + logs[split.count]));
            let starts: Vec<usize> = minima.iter().copied().filter(|&o| profile[o] < threshold).collect();
            let span = minima.last().copied().unwrap_or(0) - minima.first().copied().unwrap_or(0);
            let Some(gap) = median_gap(&starts) else { continue };
            let regular = regularity(&starts, span);
            // as regular as the minima themselves means nothing
            if (gap as f64) < 1.3 * usual as f64 { continue; }
            let separation = (split.high.mean - split.low.mean) / (split.low.deviation + split.high.deviation).max(1e-3);
            let value = regular + 0.1 * separation.min(5.0);
            if std::env::var("TRACK_DEBUG").is_ok() { eprintln!("  guess {} gap {gap} regular {regular:.3} sep {separation:.2}", starts.len()); }
            if value > best.0 { best = (value, gap, starts); }
        }
    }
    (best.1, best.2)
}

/// Keeps the most likely candidates of every stretch of a period.
fn prune(candidates: &mut Vec<Candidate>, weights: &mut Vec<f64>, period: usize, keep: usize, marks: &[usize]) {
    let mut kept = Vec::new();
    let mut from = 0;
    while from < candidates.len() {
        let block = candidates[from].offset / period.max(1);
        let mut to = from;
        while to < candidates.len() && candidates[to].offset / period.max(1) == block { to += 1; }
        let mut order: Vec<usize> = (from..to).collect();
        order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
        for (rank, index) in order.into_iter().enumerate() {
            if rank < keep || marks.contains(&candidates[index].offset) { kept.push(index); }
        }
        from = to;
    }
    kept.sort_unstable();
    *weights = kept.iter().map(|&i| weights[i]).collect();
    *candidates = kept.iter().map(|&i| candidates[i]).collect();
}
