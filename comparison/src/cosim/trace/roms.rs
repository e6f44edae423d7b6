//! Roms: the contents of a machine's tables, as records.

use super::record::RecordLayout;
use rtl_model::frame::Frame;
use rtl_model::machine::FunctionUnit;
use rtl_model::pipeline::Elaborated;

/// A table in ROM.
pub struct Rom {
    /// Its path among the machine's words, such as `gauss.table`.
    pub name: String,
    /// Names of its fields.
    pub fields: &'static [&'static str],
    /// Layout of a line.
    pub layout: RecordLayout,
    /// Its lines, address by address.
    pub lines: Vec<Vec<i64>>,
}

impl Rom {
    /// Its path in the trace's folder.
    pub fn file(&self) -> String {
        format!("rom/{}.hex", self.name)
    }
}

/// The ROM with the initial values of a function unit.
fn initial_values(name: &str, shape: FunctionUnit, values: Vec<i64>) -> Rom {
    Rom {
        name: name.to_owned(),
        fields: &["value"],
        layout: RecordLayout::of_naturals(&[shape.bits + 1]),
        lines: values.into_iter().map(|guess| vec![guess]).collect(),
    }
}

/// An unsigned value and a signed step to the next one.
const LINE: &[&str] = &["value", "step"];

/// All ROMs of a machine; those of highlights hold one table per material, in sequence.
pub fn roms(machine: &Elaborated, frame: &Frame) -> Vec<Rom> {
    let reciprocals = machine
        .reciprocals()
        .map(|(name, unit)| initial_values(name, unit.shape(), unit.guesses()));
    let roots = machine
        .roots()
        .map(|(name, unit)| initial_values(name, unit.shape(), unit.guesses()));
    let mut all: Vec<Rom> = reciprocals.into_iter().chain(roots).collect();
    if let (Some(_), Some(unit)) = (&frame.ellipsoids, machine.compensation_root()) {
        all.push(initial_values(
            "ellipse.compensation_root",
            unit.shape(),
            unit.guesses(),
        ));
    }
    if let (Some(_), Some(unit)) = (&frame.ellipsoids, machine.ray_root()) {
        all.push(initial_values(
            "ellipse.ray_root",
            unit.shape(),
            unit.guesses(),
        ));
    }
    if let (Some(ellipsoids), Some(unit)) = (&frame.ellipsoids, machine.colour())
        && ellipsoids.harmonics > 0
    {
        let root = unit.root();
        all.push(initial_values("colour.root", root.shape(), root.guesses()));
    }
    if let (Some(_), Some(unit)) = (&frame.window, machine.fragment.window_reciprocal()) {
        all.push(initial_values(
            "fragment.window.reciprocal",
            unit.shape(),
            unit.guesses(),
        ));
    }
    let m = &machine.machine;
    if let (Some(ellipsoids), Some(bits)) = (
        &frame.ellipsoids,
        m.ellipse.ellipsoid.and_then(|words| words.reach_bits),
    ) {
        // The ROM exists even if boxes use the cutoff of the frame.
        let words = if ellipsoids.kernel.reach.is_empty() {
            vec![frame.view.cutoff; 1 << bits]
        } else {
            ellipsoids.kernel.reach.clone()
        };
        let layout = RecordLayout::of_naturals(&[m.raster.cutoff.format.width() as u32]);
        let lines = words.into_iter().map(|word| vec![word]).collect();
        all.push(Rom {
            name: "ellipse.reach".into(),
            fields: &["value"],
            layout,
            lines,
        });
    }
    let line = |width: i32| RecordLayout::of_naturals(&[width as u32, width as u32 + 1]);
    let lines_of = |table: &rtl_model::functions::Table| {
        table
            .lines()
            .map(|(value, step)| vec![value, step])
            .collect::<Vec<_>>()
    };
    let falloff = m.gauss.falloff.format.width();
    all.push(Rom {
        name: "gauss.table".into(),
        fields: LINE,
        layout: line(falloff),
        lines: lines_of(machine.gaussian()),
    });
    let size = 1 << m.shade.highlight_table.index_bits;
    let highlights = machine.shade.highlights(&frame.lighting);
    let lines = highlights
        .iter()
        .flat_map(|table| {
            table
                .as_ref()
                .map_or_else(|| vec![vec![0, 0]; size], lines_of)
        })
        .collect();
    all.push(Rom {
        name: "shade.highlights".into(),
        fields: LINE,
        layout: line(m.shade.highlight.format.width()),
        lines,
    });
    if let (Some(surroundings), Some(unit), Some(words)) =
        (&frame.surroundings, machine.shade.reflect(), &m.reflect)
    {
        all.push(initial_values(
            "reflect.reciprocal",
            unit.reciprocal().shape(),
            unit.reciprocal().guesses(),
        ));
        let layout = RecordLayout::of_naturals(&[words.light.format.width() as u32; 3]);
        let lines = surroundings
            .texels
            .iter()
            .map(|texel| texel.to_vec())
            .collect();
        all.push(Rom {
            name: "reflect.light".into(),
            fields: &["red", "green", "blue"],
            layout,
            lines,
        });
    }
    if let (Some(registers), Some(words)) = (machine.windows(frame), &m.fragment.window) {
        for (name, table, word) in [
            ("density", &registers.density, words.density),
            ("hidden", &registers.hidden, words.hidden),
        ] {
            let name = format!("fragment.window.{name}");
            all.push(Rom {
                name,
                fields: LINE,
                layout: line(word.format.width()),
                lines: lines_of(table),
            });
        }
    }
    if let (Some(sheets), Some(words)) = (&frame.sheets, &m.fragment.sheets) {
        // The ROM exists even if it is not used.
        let empty = || vec![vec![0, 0]; 1 << words.table.index_bits];
        let lines = machine
            .fragment
            .sheets(sheets)
            .ratio
            .as_ref()
            .map_or_else(empty, lines_of);
        all.push(Rom {
            name: "fragment.ratio".into(),
            fields: LINE,
            layout: line(words.ratio.format.width()),
            lines,
        });
    }
    all
}
