//! Tier: the amount of testing, from `SPLATSIM_TIER`. Nothing else selects tests, so two runs of
//! one tier run the same tests.
//!
//! | tier | run by | leaves out |
//! |---|---|---|
//! | `test` | `cargo test --workspace` | long tests, and most items of long lists |
//! | `ci` | `.ci/run` | tests that take minutes, and some items of long lists |
//! | `full` | `.ci/full` | nothing |

/// The amount of testing: each tier includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tier {
    Test,
    Ci,
    Full,
}

impl Tier {
    fn parse(text: Option<&str>) -> Tier {
        match text {
            None | Some("test") => Tier::Test,
            Some("ci") => Tier::Ci,
            Some("full") => Tier::Full,
            Some(other) => panic!("SPLATSIM_TIER is {other}; it is test, ci or full"),
        }
    }

    /// The selected items of a list, by their indices: in each of the first two tiers, one of n.
    fn has(self, [test, ci]: [usize; 2], number: usize) -> bool {
        number.is_multiple_of(match self {
            Tier::Test => test,
            Tier::Ci => ci,
            Tier::Full => 1,
        })
    }
}

/// The tier of this run.
pub fn tier() -> Tier {
    Tier::parse(std::env::var("SPLATSIM_TIER").ok().as_deref())
}

/// Whether tests of a tier are run; if not, prints it.
pub fn runs(least: Tier) -> bool {
    let runs = tier() >= least;
    if !runs {
        println!(
            "skipped: a test of {}",
            if least == Tier::Full {
                ".ci/full"
            } else {
                ".ci/run"
            }
        );
    }
    runs
}

/// The selected items of a long list: in the first two tiers one of n, including the first item; in
/// the last tier all.
pub fn some<T>(one_in: [usize; 2], items: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    items
        .into_iter()
        .enumerate()
        .filter(move |(number, _)| has(one_in, *number))
        .map(|(_, item)| item)
}

/// Whether the item with this index is selected, from a list of which the first two tiers run one
/// of n.
pub fn has(one_in: [usize; 2], number: usize) -> bool {
    tier().has(one_in, number)
}

/// The number of selected cases, if the first two tiers run one of n.
pub fn of(one_in: [usize; 2], cases: usize) -> usize {
    let [test, ci] = one_in;
    cases / [test, ci, 1][tier() as usize]
}

#[test]
fn a_tier_has_all_that_the_one_before_it_has() {
    let [test, ci, full] = [None, Some("ci"), Some("full")].map(Tier::parse);
    assert!(test < ci && ci < full && Tier::parse(Some("test")) == test);
    for one_in in [[12, 4], [3, 1], [12, 12]] {
        let [of_test, of_ci, of_full] = [test, ci, full].map(|tier| {
            (0..100)
                .filter(|n| tier.has(one_in, *n))
                .collect::<Vec<_>>()
        });
        assert!(of_test.contains(&0) && of_test.iter().all(|n| of_ci.contains(n)));
        assert_eq!(
            (of_test.len(), of_ci.len(), of_full.len()),
            (
                100_usize.div_ceil(one_in[0]),
                100_usize.div_ceil(one_in[1]),
                100
            )
        );
    }
}

#[test]
#[should_panic(expected = "it is test, ci or full")]
fn another_tier_is_refused() {
    Tier::parse(Some("all"));
}
