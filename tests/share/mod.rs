//! Share: which part of the slow tests is this run's, as `SPLATSIM_SHARE` says: `all`, or a number from 0 to 143, which is 12 · part + turn.
//! Of a long list a run does one of twelve parts. Of tests that are slow as a whole it does those that have their turn: none at turns 0 and
//! 6. Of those that are slow with a part of their list, too, it does every other one. Where nothing is said the share is 0, which takes least
//! time. CI takes the number from its commit; `.ci/full` does all.

/// Parts of a long list.
const PARTS: usize = 12;
/// Turns of tests that are slow as a whole, with the two at which there are none.
const TURNS: usize = 12;

/// What of the slow tests is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Share {
    /// All.
    All,
    /// One part of each list, and the tests of one turn.
    Of { part: usize, turn: usize },
}

pub fn share() -> Share {
    Share::parse(std::env::var("SPLATSIM_SHARE").ok().as_deref())
}

impl Share {
    pub fn parse(text: Option<&str>) -> Share {
        if text == Some("all") {
            return Share::All;
        }
        let number = text.map_or(Some(0), |text| text.parse().ok().filter(|number| *number < PARTS * TURNS));
        let number: usize = number.expect("SPLATSIM_SHARE is `all` or a number from 0 to 143");
        Share::Of { part: number / TURNS, turn: number % TURNS }
    }

    /// Whether the item of this number is in its part, of lists that have at most so many.
    pub fn has(self, number: usize, parts: usize) -> bool {
        match self {
            Share::All => true,
            Share::Of { part, .. } => number % parts == part % parts,
        }
    }

    /// Whether tests of this turn are run.
    fn has_turn(self, turn: usize) -> bool {
        assert!(turn < TURNS && !turn.is_multiple_of(6), "no run has turn {turn}");
        match self {
            Share::All => true,
            Share::Of { turn: mine, .. } => turn == mine,
        }
    }

    /// Whether tests of the even turns are run, 0, or those of the odd ones, 1.
    fn alternates(self, number: usize) -> bool {
        match self {
            Share::All => true,
            Share::Of { turn, .. } => turn % 2 == number,
        }
    }
}

/// Those of some items that are this run's: at least one of them, in every run.
pub fn mine<T>(items: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    let items: Vec<T> = items.into_iter().collect();
    let parts = PARTS.min(items.len()).max(1);
    items.into_iter().enumerate().filter(move |(number, _)| share().has(*number, parts)).map(|(_, item)| item)
}

/// Whether the item of this number is this run's.
pub fn is_mine(number: usize) -> bool {
    share().has(number, PARTS)
}

/// Whether the item of this number is in this run's third.
pub fn in_third(number: usize) -> bool {
    share().has(number, 3)
}

/// Whether all is this run's.
pub fn is_all() -> bool {
    share() == Share::All
}

/// How many of so many cases are this run's, where it has one of so many parts.
pub fn of(cases: usize, parts: usize) -> usize {
    if is_all() { cases } else { cases / parts }
}

/// Whether tests of this turn are run: from 1 to 11, without 6.
pub fn has_turn(turn: usize) -> bool {
    share().has_turn(turn)
}

/// Whether a test that has a part of a list and is slow nevertheless is run: it is at even turns, 0, or at odd ones, 1.
pub fn alternates(number: usize) -> bool {
    share().alternates(number)
}

#[test]
fn every_part_meets_every_turn() {
    let all: Vec<Share> = (0..PARTS * TURNS).map(|number| Share::parse(Some(&number.to_string()))).collect();
    for part in 0..PARTS {
        for turn in 0..TURNS {
            assert!(all.contains(&Share::Of { part, turn }));
        }
        let of_part = || all.iter().filter(|share| share.has(part, PARTS));
        assert!((0..2).all(|number| of_part().any(|share| share.alternates(number) && share.has_turn(2 - number))));
    }
    assert_eq!([Share::parse(Some("all")), Share::parse(None)], [Share::All, all[0]]);
}
