//! Compares the machines `gscore`, `neo`, `flicker` and `nycu` with what their authors published.
//!
//! ```sh
//! cargo run --release --example published -- [FOLDER] [GAUSSIANS]
//! ```
//! Draws the built-in scene `city` with this number of Gaussians (2,000,000) at 1280×720, 1920×1080
//! and 2560×1440, replays the recorded work on the machines, and prints a table. Ratios come first,
//! because they depend least on the scene and on the library of cells. The book explains the table
//! in `docs/book/published.md`.
//!
//! The work is recorded on `gaussian`, which is drawn faster than machines with floating-point
//! words. Cycles depend on the boxes and pixels of splats, not on the values of other words. The
//! contribution test of `flicker` changes these, so its work is recorded on `gaussian` with this
//! test. That of `neo` is a frame of a path, recorded on `gaussian` with lists that are kept.

use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{Cycles, Detail, Lists, replay};
use rtl_model::work::Work;
use serde_json::json;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::hardware::quantise::quantise;
use splatsim::hardware::{fixed, machines};
use splatsim::output::picture::Picture;
use splatsim::performance::cost::{Cost, DEFAULT};
use splatsim::scene::{Overrides, Scene, Sequence};
use std::path::{Path, PathBuf};

/// Sizes of the pictures.
const SIZES: [(&str, (usize, usize)); 3] = [
    ("HD", (1280, 720)),
    ("FHD", (1920, 1080)),
    ("QHD", (2560, 1440)),
];
/// Square micrometres of a NAND2 and of a bit of SRAM in 28 nm, wires and macros included: usual
/// values, not those of a library.
const MICROMETRES: [f64; 2] = [0.5, 0.3];
/// Four times the cores of a machine with four of them.
const FOUR_TIMES_THE_CORES: [&str; 6] = [
    "timing.engines=16",
    "bin.tiles_per_cycle=8",
    "timing.sort.units=16",
    "timing.project.units=16",
    "timing.ellipse.units=16",
    "timing.fetch.splats=16",
];
/// Four times the bandwidth. The latency is the same, so four times the requests are in flight.
const FOUR_TIMES_THE_CHANNELS: [&str; 3] = [
    "timing.memory.channels=16",
    "timing.memory.outstanding=512",
    "timing.fetch.fifo=256",
];
/// Memory that takes no time.
const IDEAL_MEMORY: [&str; 3] = [
    "timing.memory.ideal=true",
    "timing.memory.hit_latency=1",
    "timing.memory.outstanding=1024",
];

fn built(name: &str, settings: &[&str]) -> Result<Elaborated> {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    fixed::elaborate(&machines::load(name, &settings)?)
}

/// The recorded work of the scene in a size, with settings of `gaussian`, and its picture.
fn work(scene: &Path, size: (usize, usize), settings: &[&str]) -> Result<(Work, Picture)> {
    let overrides = Overrides { size: Some(size) };
    let scene = Scene::load(scene, &overrides)?;
    let mut machine = built("gaussian", settings)?;
    machine.records_choices = true;
    let quantised = quantise(&scene, &machine.machine)?;
    let (drawing, _, work) = fixed::draw_measured(&machine, &quantised);
    Ok((work, fixed::picture(&machine, &drawing)))
}

/// The frame after some others on a path: the camera turns by this many pixels per frame.
const FRAME: usize = 6;
const PAN_PX: u32 = 8;

/// The recorded work of that frame, with lists that are kept as `neo` keeps them.
fn kept_work(scene: &Path, size: (usize, usize)) -> Result<Work> {
    let overrides = Overrides { size: Some(size) };
    let mut sequence = Sequence::load(scene, &overrides, None)?;
    let settings = [
        "sort.kind=incremental",
        "sort.incremental.tile_px=64",
        "timing.tile.side_px=64",
    ];
    let mut machine = built("gaussian", &settings)?;
    machine.records_choices = true;
    let quantised = quantise(sequence.frame(FRAME)?, &machine.machine)?;
    Ok(fixed::draw_measured(&machine, &quantised).2)
}

fn cycles(name: &str, settings: &[&str], work: &Work) -> Result<Cycles> {
    Ok(replay(
        &built(name, settings)?.timing,
        work,
        Detail::Accounts,
    ))
}

/// Cycles of one machine over those of another.
fn speed(name: &str, from: &[&str], to: &[&str], work: &Work) -> Result<f64> {
    Ok(cycles(name, from, work)?.total as f64 / cycles(name, to, work)?.total as f64)
}

fn frames_per_second(name: &str, work: &Work) -> Result<f64> {
    let machine = built(name, &[])?;
    let total = replay(&machine.timing, work, Detail::Total).total;
    Ok(machine.timing.timing.clock_hz as f64 / total as f64)
}

/// Thousands of NAND2, thousands of bits of SRAM, and square millimetres in 28 nm.
fn area(name: &str, settings: &[&str]) -> Result<[f64; 3]> {
    let gates = Cost::new(&built(name, settings)?, &DEFAULT).gates;
    let nand2 = (gates.logic + gates.flip_flops) / 1e3;
    let [of_gate, of_bit] = MICROMETRES;
    let area = (nand2 * of_gate + gates.sram_kbit * of_bit) / 1e3;
    Ok([nand2, gates.sram_kbit, area])
}

/// Share of the traffic of these requesters, by their places in the list of requesters.
fn share(cycles: &Cycles, requesters: &[usize]) -> f64 {
    let bytes = |nth: &usize| cycles.memory.bytes[*nth].iter().sum::<u64>();
    requesters.iter().map(bytes).sum::<u64>() as f64 / cycles.memory.total_bytes() as f64
}

/// The table.
struct Table(Vec<[String; 5]>);

impl Table {
    fn row(&mut self, machine: &str, figure: &str, published: f64, model: f64) {
        let text = |value: f64| match value {
            large if large >= 1000.0 => format!("{large:.0}"),
            large if large >= 10.0 => format!("{large:.1}"),
            small => format!("{small:.2}"),
        };
        self.0.push([
            machine.into(),
            figure.into(),
            text(published),
            text(model),
            format!("{:.2}", model / published),
        ]);
    }

    fn print(&self) {
        println!("| machine | figure | published | model | model over published |");
        println!("|---|---|---|---|---|");
        for row in &self.0 {
            println!("| {} |", row.join(" | "));
        }
    }
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "out".into()));
    let count = arguments.next().unwrap_or_else(|| "2000000".into());
    let count: u32 = count
        .parse()
        .map_err(|_| Error::input(format!("{count} is not a number of Gaussians")))?;
    let failed = |error: std::io::Error| Error::Job(format!("{}: {error}", folder.display()));
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let scene = folder.join("city.json");
    // The camera of the built-in scene.
    let text = json!({
        "splats": {"gaussians": "city", "count": count},
        "camera": {"eye": [0, 0.3, 3.95], "target": [0, 0.32, 0], "up": [0, 1, 0], "fov_y_degrees": 50, "near": 0.05},
        "image": {"background": [0.62, 0.76, 0.94, 1]},
    });
    std::fs::write(&scene, text.to_string()).map_err(failed)?;

    let (mut works, mut pictures) = (Vec::new(), Vec::new());
    for (name, size) in SIZES {
        let (work, picture) = work(&scene, size, &[])?;
        let boxes = work.bins(16);
        let mut lengths: Vec<usize> = (0..boxes.tiles())
            .map(|tile| boxes.of(tile).len())
            .collect();
        lengths.sort_unstable();
        let at = |tenth: usize| lengths[(lengths.len() - 1) * tenth / 10];
        println!(
            "{name}: {} entries of boxes in {} tiles of 16 pixels; lists of {} (a tenth is shorter), {}, {} and at most {}",
            boxes.entries(),
            boxes.tiles(),
            at(1),
            at(5),
            at(9),
            at(10)
        );
        works.push(work);
        pictures.push(picture);
    }
    println!();
    let [hd, fhd, qhd] = &works[..] else {
        return Err(Error::job("three sizes"));
    };

    let mut table = Table(Vec::new());
    let large = cycles("gscore", &[], qhd)?;
    println!(
        "gscore, QHD: {} cycles, and {} with memory that takes no time\n",
        large.total,
        cycles("gscore", &IDEAL_MEMORY, qhd)?.total
    );
    table.row(
        "gscore",
        "4 times the cores, speed",
        1.12,
        speed("gscore", &[], &FOUR_TIMES_THE_CORES, qhd)?,
    );
    table.row(
        "gscore",
        "4 times the bandwidth, speed",
        3.83,
        speed("gscore", &[], &FOUR_TIMES_THE_CHANNELS, qhd)?,
    );
    let both = [&FOUR_TIMES_THE_CORES[..], &FOUR_TIMES_THE_CHANNELS].concat();
    table.row(
        "gscore",
        "4 times the bandwidth, with 4 times the cores",
        3.83,
        speed("gscore", &FOUR_TIMES_THE_CORES, &both, qhd)?,
    );
    table.row(
        "gscore",
        "share of traffic, writing and sorting lists",
        0.693,
        share(&large, &[1, 2]),
    );
    let rates = [hd, fhd, qhd].map(|work| frames_per_second("gscore", work));
    let [hd_rate, fhd_rate, qhd_rate] = rates;
    let (hd_rate, fhd_rate, qhd_rate) = (hd_rate?, fhd_rate?, qhd_rate?);
    table.row(
        "gscore",
        "frames/s, FHD over HD",
        31.1 / 66.7,
        fhd_rate / hd_rate,
    );
    table.row(
        "gscore",
        "frames/s, QHD over HD",
        15.8 / 66.7,
        qhd_rate / hd_rate,
    );
    table.row("gscore", "frames/s, QHD", 15.8, qhd_rate);
    table.row(
        "gscore",
        "MB per frame, QHD",
        104_600.0 / 60.0,
        large.memory.total_bytes() as f64 / 1e6,
    );
    table.row("gscore", "area, mm²", 3.9, area("gscore", &[])?[2]);

    let path = folder.join("city-path.json");
    let turning = json!({
        "splats": text["splats"],
        "camera_path": {"pan_pixels": PAN_PX, "frames": FRAME + 1, "camera": text["camera"]},
        "image": text["image"],
    });
    std::fs::write(&path, turning.to_string()).map_err(failed)?;
    let kept = kept_work(&path, SIZES[2].1)?;
    let of_neo = cycles("neo", &[], &kept)?;
    let lists = kept.lists.iter().flat_map(|lists| &lists.tiles);
    let [mut entries, mut new] = [0, 0];
    for list in lists {
        entries += list.splats.len();
        new += list.new.iter().filter(|new| **new).count();
    }
    println!(
        "neo, frame {FRAME}: {entries} entries in tiles of 64 pixels, of which {new} are new and {} have departed\n",
        entries - kept.kept_bins().map_or(0, |bins| bins.listed())
    );
    table.row(
        "neo",
        "traffic of `gscore` over `neo`, QHD",
        104.6 / 19.6,
        large.memory.total_bytes() as f64 / of_neo.memory.total_bytes() as f64,
    );
    table.row(
        "neo",
        "MB per frame, QHD",
        19_600.0 / 60.0,
        of_neo.memory.total_bytes() as f64 / 1e6,
    );
    let rate = 1e9 / of_neo.total as f64;
    table.row(
        "neo",
        "frames/s over those of `gscore`, QHD",
        99.3 / 15.8,
        rate / qhd_rate,
    );
    table.row("neo", "frames/s, QHD", 99.3, rate);

    // Blocks that fail the test have no fragments, so `flicker` has work of its own.
    let test = json!(built("flicker", &[])?.machine.contribution);
    let (tested, lossy) = &work(&scene, SIZES[1].1, &[&format!("contribution={test}")])?;
    // The FIFO in front of raster, which the tests of blocks fill. Memory takes no time, because
    // the model's FIFO also covers its latency.
    let fifo = |places: u32| -> Result<u64> {
        let places = format!("timing.fetch.fifo={places}");
        let settings = [&IDEAL_MEMORY[..], &[&places]].concat();
        Ok(cycles("flicker", &settings, tested)?.total)
    };
    let [one, sixteen, most] = [fifo(1)?, fifo(16)?, fifo(128)?];
    table.row(
        "flicker",
        "FIFO of 128 over 1 place, speed",
        1.36,
        one as f64 / most as f64,
    );
    table.row(
        "flicker",
        "FIFO of 16 places, share of the speed of 128",
        0.96,
        most as f64 / sixteen as f64,
    );
    let set = Lists::new(&built("flicker", &[])?.timing, tested).set_bits();
    let of_boxes = fhd.bins(16).entries() as f64 * 256.0;
    table.row(
        "flicker",
        "list of a pixel, 4×4 test over 16×16 boxes",
        0.1,
        set as f64 * 16.0 / of_boxes,
    );
    table.row(
        "flicker",
        "entries, tiles of 4 over 16 pixels",
        4.0,
        fhd.bins(4).entries() as f64 / fhd.bins(16).entries() as f64,
    );
    // From 25.99 to 25.88 dB against photographs: the error that the test adds, in dB.
    let added = -10.0 * (10f64.powf(-2.588) - 10f64.powf(-2.599)).log10();
    table.row(
        "flicker",
        "error of the test, PSNR in dB",
        added,
        metrics(lossy, &pictures[1])
            .psnr_db
            .unwrap_or(f64::INFINITY),
    );
    let [own, without] = [
        area("flicker", &[])?[2],
        area(
            "flicker",
            &["contribution=null", "timing.contribution=null"],
        )?[2],
    ];
    table.row("flicker", "area of the test, mm²", 0.09, own - without);
    table.row("flicker", "area, mm²", 3.47, own);

    let [gates, kbit, square] = area("nycu", &[])?;
    table.row("nycu", "logic, thousands of NAND2", 1143.8, gates);
    table.row("nycu", "SRAM, KB", 120.0, kbit / 8.0);
    table.row("nycu", "area, mm²", 0.66, square);
    table.row(
        "nycu",
        "area of the published gates and SRAM, mm²",
        0.66,
        (1143.8 * MICROMETRES[0] + 983.0 * MICROMETRES[1]) / 1e3,
    );
    table.row(
        "nycu",
        "frames/s, FHD",
        129.0,
        frames_per_second("nycu", fhd)?,
    );
    table.print();
    Ok(())
}
