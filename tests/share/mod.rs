//! Share: which part of the long work is this run's. A run of CI does a part, which its commit says; `.ci/full` does all.

/// Part k of n, from 1 on, as `SPLATSIM_SHARE=k/n` asks; all, where nothing is asked.
pub fn share() -> [usize; 2] {
    parse(std::env::var("SPLATSIM_SHARE").ok().as_deref())
}

pub fn parse(share: Option<&str>) -> [usize; 2] {
    let numbers = share.map(|share| share.split_once('/').and_then(|(k, n)| Some([k.parse().ok()?, n.parse().ok()?])));
    let [k, n]: [usize; 2] = numbers.map_or([1, 1], |numbers| numbers.expect("SPLATSIM_SHARE is k/n"));
    assert!((1..=n).contains(&k), "SPLATSIM_SHARE is k/n, k from 1 to n");
    [k, n]
}

/// Those of some items that are this run's: at least one of them, in every run.
pub fn mine<T>(items: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    let items: Vec<T> = items.into_iter().collect();
    let [k, n] = share();
    let n = n.min(items.len()).max(1);
    items.into_iter().enumerate().filter(move |(number, _)| number % n == k % n).map(|(_, item)| item)
}

/// Whether the item of this number is this run's.
pub fn is_mine(number: usize) -> bool {
    let [k, n] = share();
    number % n == k % n
}

/// Whether a slow test, or a part of one, has its turn: in one run of CI in three, in all others always.
pub fn in_third(turn: usize) -> bool {
    let [k, n] = share();
    n < 3 || turn % 3 == k % 3
}
