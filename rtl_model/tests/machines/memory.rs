//! How long does memory with more than one channel take: channels, ranks, refresh, turns to
//! writing, rows, presets? Numbers are worked out by hand.

use crate::frames::Rng;
use rtl_model::Machine;
use rtl_model::machine::timing::{Memory, Preset};
use rtl_model::timing::{Direction, Request, serve};
use serde_json::json;

/// One channel of 16 bytes per cycle in bursts of 64, whose rows take no time.
fn plain() -> Memory {
    let memory = Machine::named("reference").unwrap().timing.memory;
    Memory {
        bytes_per_cycle: 16,
        hit_latency: 10,
        miss_latency: 10,
        burst_bytes: 64,
        row_bytes: 2048,
        banks: 8,
        ..memory
    }
}

fn read(address: u64) -> Request {
    Request {
        cycle: 0,
        address,
        bytes: 64,
        direction: Direction::Read,
    }
}

fn write(address: u64) -> Request {
    Request {
        direction: Direction::Write,
        ..read(address)
    }
}

/// Cycles in which all requests are served, if all are issued at once.
fn all_at_once(memory: Memory, requests: &[Request]) -> u64 {
    serve(memory, requests.iter().copied(), requests.len() as u32)
}

#[test]
fn every_channel_moves_its_own_bytes_line_by_line() {
    let lines: Vec<Request> = (0..64).map(|line| read(64 * line)).collect();
    // 64 bursts of 4 cycles, and the latency.
    assert_eq!(all_at_once(plain(), &lines), 256 + 10);
    for (channels, cycles) in [(1, 256), (2, 128), (4, 64), (16, 16), (64, 4)] {
        assert_eq!(
            all_at_once(
                Memory {
                    channels: Some(channels),
                    ..plain()
                },
                &lines
            ),
            cycles + 10,
            "{channels} channels"
        );
    }
    // Two consecutive lines per channel: every other line of four channels is in all of them, every
    // eighth in one.
    let coarse = Memory {
        channels: Some(4),
        interleave_bytes: Some(128),
        ..plain()
    };
    let every = |step: u64| {
        (0..32)
            .map(|line| read(64 * step * line))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        [2, 8].map(|step| all_at_once(coarse, &every(step))),
        [32 / 4 * 4 + 10, 32 * 4 + 10]
    );
    // A request for lines of all channels is done when the last has arrived.
    let long = [Request {
        bytes: 1024,
        ..read(0)
    }];
    assert_eq!(
        all_at_once(
            Memory {
                channels: Some(4),
                ..plain()
            },
            &long
        ),
        1024 / 64 + 10
    );
}

#[test]
fn thousandths_of_a_byte_add_up() {
    let lines: Vec<Request> = (0..1000).map(|line| read(64 * line)).collect();
    let memory = Memory {
        bytes_per_cycle: 12,
        bytes_per_cycle_permille: Some(800),
        ..plain()
    };
    assert_eq!(all_at_once(memory, &lines), 64_000 * 10 / 128 + 10);
}

/// Cycles until this many of them were without a refresh, counted cycle by cycle. A refresh takes
/// the last cycles of each interval.
fn until_awake_for(cycles: u64, interval: u64, refresh: u64) -> u64 {
    (1..)
        .scan(0, |awake, cycle| {
            *awake += u64::from((cycle - 1) % interval < interval - refresh);
            Some((cycle, *awake))
        })
        .find(|(_, awake)| *awake == cycles)
        .unwrap()
        .0
}

#[test]
fn a_refresh_takes_its_share_of_the_time() {
    for (interval, refresh) in [(100, 10), (64, 1), (1560, 112), (7, 6)] {
        let memory = Memory {
            refresh_interval_cycles: Some(interval),
            refresh_cycles: Some(refresh),
            ..plain()
        };
        for bursts in [1, 22, 23, 200] {
            let lines: Vec<Request> = (0..bursts).map(|line| read(64 * line)).collect();
            let moved = until_awake_for(4 * bursts, interval.into(), refresh.into());
            assert_eq!(
                all_at_once(memory, &lines),
                moved + 10,
                "{bursts} bursts, {refresh} of {interval}"
            );
        }
    }
}

#[test]
fn a_refresh_closes_rows() {
    let memory = Memory {
        miss_latency: 30,
        refresh_interval_cycles: Some(100),
        refresh_cycles: Some(10),
        ..plain()
    };
    // One after the other: 14 cycles each, except the first after each refresh, which opens the row
    // again.
    let one_by_one =
        |memory: Memory, many: u64| serve(memory, (0..many).map(|line| read(64 * line)), 1);
    assert_eq!(
        one_by_one(
            Memory {
                refresh_interval_cycles: None,
                refresh_cycles: None,
                ..memory
            },
            6
        ),
        34 + 5 * 14
    );
    // The sixth is issued in cycle 90, during a refresh, and starts in cycle 100 with a closed row.
    assert_eq!(one_by_one(memory, 6), 100 + 34);
}

#[test]
fn a_turn_to_writing_costs_once_per_batch() {
    let alternating: Vec<Request> = (0..32)
        .flat_map(|line| [read(64 * line), write((1 << 20) + 64 * line)])
        .collect();
    let bytes = 64 * 4 + 10;
    for (batch, turns) in [
        (None, 32),
        (Some(1), 32),
        (Some(2), 16),
        (Some(16), 2),
        (Some(64), 1),
    ] {
        let memory = Memory {
            turnaround_cycles: Some(7),
            write_batch: batch,
            ..plain()
        };
        assert_eq!(
            all_at_once(memory, &alternating),
            bytes + 7 * turns,
            "{batch:?}"
        );
    }
    let memory = Memory {
        turnaround_cycles: Some(7),
        ..plain()
    };
    let writes: Vec<Request> = (0..32).map(|line| write(64 * line)).collect();
    assert_eq!(
        all_at_once(memory, &writes),
        32 * 4 + 10,
        "nothing was read"
    );
}

#[test]
fn a_change_of_ranks_costs_its_cycles_and_doubles_the_rows() {
    // Rows 0 to 7 are in the first rank, 8 to 15 in the second.
    let alternating: Vec<Request> = (0..10)
        .flat_map(|line| [read(64 * line), read(8 * 2048 + 64 * line)])
        .collect();
    let two = Memory {
        ranks: Some(2),
        rank_switch_cycles: Some(3),
        ..plain()
    };
    assert_eq!(all_at_once(two, &alternating), 20 * 4 + 19 * 3 + 10);
    // With one rank, each request opens its row again; with two, both rows stay open.
    let of = |memory: Memory| {
        serve(
            Memory {
                miss_latency: 30,
                ..memory
            },
            alternating.iter().copied(),
            1,
        )
    };
    assert_eq!(of(plain()), 20 * 34);
    assert_eq!(
        of(Memory {
            rank_switch_cycles: None,
            ..two
        }),
        2 * 34 + 18 * 14
    );
}

#[test]
fn a_bank_and_a_rank_open_rows_now_and_then() {
    // The same bank, each time another row.
    let conflicts: Vec<Request> = (0..20).map(|row| read(8 * 2048 * row)).collect();
    let memory = Memory {
        row_cycles: Some(25),
        ..plain()
    };
    assert_eq!(all_at_once(memory, &conflicts), 19 * 25 + 4 + 10);
    // Each time another bank: the first four at once, the next four at the end of the window.
    let rows: Vec<Request> = (0..8).map(|row| read(2048 * row)).collect();
    assert_eq!(all_at_once(memory, &rows), 8 * 4 + 10);
    let memory = Memory {
        four_rows_cycles: Some(40),
        ..plain()
    };
    assert_eq!(all_at_once(memory, &rows), 40 + 4 * 4 + 10);
}

/// Two lines of the request are in each channel.
#[test]
fn all_bytes_for_which_a_row_opens_arrive_after_the_latency_of_a_closed_row() {
    let memory = Memory {
        channels: Some(4),
        interleave_bytes: Some(64),
        miss_latency: 30,
        ..plain()
    };
    let request = Request {
        bytes: 512,
        ..read(0)
    };
    assert_eq!(all_at_once(memory, &[request]), 2 * 4 + 30);
}

/// Twenty bursts of a row take the bus 80 cycles; each of two other rows is then opened.
#[test]
fn a_bank_opens_its_next_row_when_the_one_before_is_served() {
    let memory = Memory {
        miss_latency: 30,
        row_cycles: Some(50),
        ..plain()
    };
    let mut requests: Vec<Request> = (0..20).map(|burst| read(64 * burst)).collect();
    requests.extend([1, 2].map(|row| read(8 * 2048 * row)));
    assert_eq!(all_at_once(memory, &requests), 80 + 50 + 4 + 30);
}

/// Requests to an open row are served before another row is opened in its bank.
#[test]
fn an_open_row_is_used_before_the_bank_opens_another() {
    let memory = Memory {
        miss_latency: 30,
        row_cycles: Some(50),
        ..plain()
    };
    let [row, other] = [0, 8 * 2048];
    let cycles = all_at_once(
        memory,
        &[read(row), read(other), read(row + 64), read(row + 128)],
    );
    // The other row is opened after 50 cycles; the remaining data has arrived by then.
    assert_eq!(cycles, 50 + 4 + 30);
}

#[test]
fn more_channels_never_take_more_cycles() {
    for seed in 0..300 {
        let mut rng = Rng(seed);
        let many = 1 + rng.below(200);
        let requests: Vec<Request> = (0..many)
            .map(|_| {
                let lines = 1 << [4, 8, 16][rng.below(3) as usize];
                Request {
                    bytes: 64 * (1 + rng.below(20)),
                    ..read(64 * rng.below(lines))
                }
            })
            .collect();
        let memory = Memory {
            bytes_per_cycle: 1 + rng.below(40) as u32,
            bytes_per_cycle_permille: Some(rng.below(1000) as u32),
            interleave_bytes: Some(64 << rng.below(8)),
            refresh_interval_cycles: Some(50 + rng.below(200) as u32),
            refresh_cycles: Some(rng.below(40) as u32),
            ..plain()
        };
        let cycles: Vec<u64> = (0..7)
            .map(|log| {
                all_at_once(
                    Memory {
                        channels: Some(1 << log),
                        ..memory
                    },
                    &requests,
                )
            })
            .collect();
        assert!(
            cycles.is_sorted_by(|fewer, more| more <= fewer),
            "{cycles:?} cycles of 1, 2, 4… channels, seed {seed}"
        );
    }
}

/// At any clock, a machine gets the bandwidth of the data sheet, rounded down to a thousandth of a
/// byte per cycle. Each time is at least that of the data sheet, and less than a cycle longer.
#[test]
fn a_preset_is_as_fast_as_its_data_sheet_at_any_clock() {
    // GB/s; read latency, tRC, tREFI, tRFC in ps.
    let sheets = [
        (Preset::Lpddr4, 51.2, [17_500, 60_000, 3_904_000, 280_000]),
        (Preset::Lpddr5, 51.2, [21_250, 60_000, 3_906_000, 210_000]),
        (Preset::Ddr5, 38.4, [16_640, 48_000, 3_900_000, 295_000]),
        (Preset::Hbm2, 256.0, [14_000, 48_000, 3_900_000, 260_000]),
    ];
    for (preset, gigabytes, times) in sheets {
        for clock_hz in [
            50_000_000_u64,
            333_333_333,
            400_000_000,
            1_000_000_000,
            1_700_000_000,
        ] {
            let memory = plain().with_preset(preset).resolved(clock_hz);
            let bytes = memory.bytes_per_1000_cycles() as f64 / 1000.0 * clock_hz as f64;
            assert!(
                bytes <= gigabytes * 1e9 && bytes > gigabytes * 0.999e9,
                "{preset:?} at {clock_hz}: {bytes}"
            );
            let cycles = [
                Some(memory.hit_latency),
                memory.row_cycles,
                memory.refresh_interval_cycles,
                memory.refresh_cycles,
            ]
            .map(Option::unwrap);
            for (cycles, picoseconds) in cycles.into_iter().zip(times) {
                let exact = picoseconds as f64 * clock_hz as f64 / 1e12;
                let longer = f64::from(cycles) - exact;
                assert!(
                    (-1e-6..1.0).contains(&longer),
                    "{preset:?} at {clock_hz}: {cycles} cycles, but {exact}"
                );
            }
        }
    }
}

#[test]
fn fields_of_a_machine_override_its_preset() {
    let mut machine = Machine::named("reference").unwrap();
    machine.timing.memory = serde_json::from_value(json!({
        "preset": "hbm2", "outstanding": 16, "banks": 4, "channels": 2, "refresh_interval_cycles": 0,
    }))
    .unwrap();
    let memory = machine.elaborate().unwrap().timing.timing.memory;
    assert_eq!(
        (
            memory.banks,
            memory.channels,
            memory.refresh_interval_cycles
        ),
        (4, Some(2), Some(0))
    );
    // 32 GB/s per channel at 400 MHz.
    assert_eq!(
        (
            memory.bytes_per_cycle,
            memory.burst_bytes,
            memory.hit_latency
        ),
        (80, 64, 6)
    );
    // Fields absent from the file are absent in the output.
    let written = serde_json::to_value(machine.timing.memory).unwrap();
    assert!(
        written.get("bytes_per_cycle").is_none() && written["banks"] == 4,
        "{written}"
    );
}

#[test]
fn impossible_memory_is_refused_in_a_sentence() {
    let refused = |memory: Memory| {
        let mut machine = Machine::named("reference").unwrap();
        machine.timing.memory = memory;
        machine.elaborate().map(|_| ()).unwrap_err()
    };
    let some = Some;
    let wrong = [
        (
            Memory {
                channels: some(0),
                ..plain()
            },
            "timing.memory.channels is 0: it must be a power of two up to 64",
        ),
        (
            Memory {
                channels: some(3),
                ..plain()
            },
            "timing.memory.channels is 3: it must be a power of two up to 64",
        ),
        (
            Memory {
                ranks: some(16),
                ..plain()
            },
            "timing.memory.ranks is 16: it must be a power of two up to 8",
        ),
        (
            Memory {
                channels: some(2),
                interleave_bytes: some(32),
                ..plain()
            },
            "timing.memory.interleave_bytes is 32: a burst of 64 bytes comes from one channel",
        ),
        (
            Memory {
                bytes_per_cycle_permille: some(1000),
                ..plain()
            },
            "timing.memory.bytes_per_cycle_permille is 1000: it can be 0 to 999, because 1000 are a byte",
        ),
        (
            Memory {
                write_batch: some(0),
                ..plain()
            },
            "timing.memory.write_batch is 0: it can be 1 to 1048576",
        ),
        (
            Memory {
                row_cycles: some(1 << 21),
                ..plain()
            },
            "timing.memory.row_cycles is 2097152: it can be 0 to 1048576",
        ),
        (
            Memory {
                refresh_interval_cycles: some(50),
                refresh_cycles: some(50),
                ..plain()
            },
            "timing.memory.refresh_cycles is 50: it must be less than refresh_interval_cycles, 50, so that memory can move data",
        ),
        (
            Memory {
                refresh_cycles: some(50),
                ..plain()
            },
            "timing.memory.refresh_cycles is 50, but refresh_interval_cycles is 0 or left out: nothing is refreshed",
        ),
        (
            Memory {
                bytes_per_cycle: 0,
                ..plain()
            },
            "timing.memory.bytes_per_cycle is 0: it can be 1 to 1048576",
        ),
    ];
    for (memory, sentence) in wrong {
        assert_eq!(refused(memory), [sentence]);
    }
    let unknown = serde_json::from_value::<Memory>(json!({"preset": "ddr6", "outstanding": 16}))
        .unwrap_err()
        .to_string();
    for name in ["lpddr4-3200-x4", "lpddr5-6400-x4", "ddr5-4800", "hbm2"] {
        assert!(unknown.contains(name), "{unknown}");
    }
}

/// Writes gathered by a channel are stored on chip, and their bits are counted.
#[test]
fn gathered_writes_are_stored_on_chip() {
    let bits = |channels: u32, batch: u32| {
        let mut machine = Machine::named("reference").unwrap();
        machine.timing.memory = Memory {
            channels: Some(channels),
            write_batch: Some(batch),
            ..plain()
        };
        machine.elaborate().unwrap().timing.storage.memory_bits
    };
    // Bursts of 64 bytes with an address of 48 bits.
    assert_eq!(
        [bits(2, 16) - bits(2, 1), bits(4, 16) - bits(4, 1)],
        [2 * 16 * (512 + 48), 4 * 16 * (512 + 48)]
    );
}

#[test]
fn explicit_defaults_change_nothing() {
    let explicit = Memory {
        channels: Some(1),
        ranks: Some(1),
        interleave_bytes: Some(64),
        refresh_interval_cycles: Some(0),
        turnaround_cycles: Some(0),
        write_batch: Some(1),
        row_cycles: Some(0),
        four_rows_cycles: Some(0),
        bytes_per_cycle_permille: Some(0),
        rank_switch_cycles: Some(0),
        ..plain()
    };
    let mut rng = Rng(5);
    let requests: Vec<Request> = (0..500)
        .map(|_| {
            if rng.below(3) == 0 {
                write(64 * rng.below(4096))
            } else {
                read(64 * rng.below(4096))
            }
        })
        .collect();
    for miss_latency in [10, 40] {
        let of = |memory: Memory| {
            serve(
                Memory {
                    miss_latency,
                    ..memory
                },
                requests.iter().copied(),
                8,
            )
        };
        assert_eq!(of(explicit), of(plain()));
        // With one channel the general path takes as long as the short one.
        assert_eq!(
            of(Memory {
                refresh_interval_cycles: Some(1 << 20),
                ..explicit
            }),
            of(plain())
        );
    }
}
