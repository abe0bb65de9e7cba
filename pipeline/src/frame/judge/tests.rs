use super::*;

const STAKE: Stake = Stake {
    allowed: Plan(7),
    moving: true,
    samples: 256.0,
    tiles: None,
    found: 141.0,
    screen: 99.0,
    full: 27.0,
};

/// A judge that has seen `rounds` trials in which each test took `madds` and left the share that `left` says of its plan.
fn taught(rounds: u32, madds: u32, left: impl Fn(Plan) -> f64) -> Judge {
    let mut judge = Judge::new();
    judge.learn_tile(1_000_000_000, false);
    for _ in 0..rounds {
        for plan in STAKE.allowed.within().filter(|plan| plan.last().is_some()) {
            judge.learn(&STAKE, plan, &Did { madds, samples: STAKE.samples, left: left(plan) });
        }
        judge.learn_trial(&STAKE, 1_000_000_000);
    }
    judge
}

#[test]
fn what_is_not_known_is_tried_and_where_little_is_at_stake_nothing_is_run() {
    let judge = Judge::new();
    assert_eq!(judge.plan(&STAKE), None);
    assert_eq!(judge.plan(&Stake { samples: 2.0, ..STAKE }), Some(Plan(0)));
}

#[test]
fn a_test_that_takes_nothing_away_is_given_up() {
    let judge = taught(1000, 200, |_| 1.0);
    assert_eq!(judge.plan(&STAKE), Some(Plan(0)));
}

#[test]
fn of_two_tests_that_take_away_the_same_one_is_run() {
    // Side planes take nine tenths, facing nothing, and edges the same as side planes. They are found for the screen anyway.
    let judge = taught(1000, 100, |plan| match plan.last() {
        Some((Plan::SIDES, _)) => 0.1,
        Some((Plan::EDGES, before)) if !before.has(Plan::SIDES) => 0.1,
        _ => 1.0,
    });
    assert_eq!(judge.plan(&STAKE), Some(Plan(Plan::EDGES)));
}

#[test]
fn a_test_that_only_helps_the_next_is_run_for_that() {
    let judge = taught(1000, 100, |plan| match plan.last() {
        Some((Plan::EDGES, before)) if before.has(Plan::FACING) => 0.1,
        _ => 1.0,
    });
    assert_eq!(judge.plan(&STAKE), Some(Plan(Plan::FACING | Plan::EDGES)));
}

#[test]
fn plans_come_after_those_that_they_go_on_from() {
    let all: Vec<_> = Plan(7).within().collect();
    assert_eq!(all.len(), Plan::COUNT);
    for plan in &all {
        if let Some((test, before)) = plan.last() {
            assert!(before.0 < plan.0 && plan.has(test) && !before.has(test), "{plan:?}");
        }
    }
    assert_eq!(Plan(5).within().count(), 4);
}

#[test]
fn what_one_bin_has_learnt_another_knows() {
    let mut judge = Judge::new();
    judge.join(&taught(1000, 200, |_| 1.0));
    assert!(judge.has_learnt());
    assert_eq!(judge.plan(&STAKE), Some(Plan(0)));
}

#[test]
fn a_screen_that_never_takes_anything_is_used_seldom_and_one_that_does_always() {
    for (share, least, most) in [(0.0, 10, 140), (1.0, 1000, 1000)] {
        let mut judge = Judge::new();
        (0..100).for_each(|_| judge.learn_screen(0.5, share, 256.0));
        let used = (0..1000).filter(|_| judge.wants_samples_screened(0.5, 9.0, 27.0)).count();
        assert!((least..=most).contains(&used), "{used}");
    }
}
