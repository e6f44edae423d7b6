use super::*;

/// All kinds of frames that a machine can draw.
fn kinds(machine: &Elaborated) -> Vec<Kind> {
    let m = &machine.machine;
    let can = [
        m.ellipse.ellipsoid.is_some(),
        m.ellipse.ellipsoid.is_some(),
        m.sorting().is_some(),
        m.fragment.sheets.is_some(),
    ];
    let all = (0..16u8).map(|bits| [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1));
    let kinds = all.filter(|kind| kind.iter().zip(can).all(|(wanted, can)| can || !wanted));
    // A machine that groups by windows always does so, and has all splats lit before.
    let windows = m.fragment.window.is_some();
    let kind = |[ellipsoids, preshaded, sorted, sheets]: [bool; 4]| Kind {
        ellipsoids,
        preshaded: preshaded || windows,
        harmonics: 0,
        sorted,
        sheets,
        windows,
        mirrors: false,
    };
    let all: Vec<Kind> = kinds.map(kind).collect();
    let of_harmonics = |kind: &Kind| Kind {
        harmonics: 2,
        ..*kind
    };
    let has_harmonics = |kind: &&Kind| kind.ellipsoids && m.colour.is_some();
    let coloured = all.iter().filter(has_harmonics).map(of_harmonics);
    all.iter().copied().chain(coloured).collect()
}

/// All streams of all machines, for all kinds of frames.
fn all() -> Vec<Stream> {
    let of = |machine: &Elaborated| {
        let kinds = kinds(machine).into_iter();
        kinds
            .flat_map(|kind| {
                constants(machine, kind)
                    .into_iter()
                    .chain(streams(machine, kind))
            })
            .collect::<Vec<_>>()
    };
    machines().iter().flat_map(of).collect()
}

fn machines() -> Vec<Elaborated> {
    Machine::names()
        .map(|name| Machine::named(name).unwrap().elaborate().unwrap())
        .collect()
}

#[test]
fn records_have_the_widths_of_their_fields() {
    for stream in all() {
        let places = stream.places();
        for (i, field) in stream.fields.iter().enumerate() {
            let top = if i == 0 {
                stream.width()
            } else {
                places[i - 1]
            };
            assert_eq!(
                places[i] + field.width(),
                top,
                "{} {}",
                stream.name,
                field.name
            );
        }
        assert_eq!(places.last(), Some(&0), "{}", stream.name);
    }
}

#[test]
fn field_names_are_unique_and_depend_on_earlier_fields() {
    for stream in all() {
        for (i, field) in stream.fields.iter().enumerate() {
            let before: Vec<&str> = stream.fields[..i]
                .iter()
                .map(|field| field.name.as_str())
                .collect();
            assert!(
                !before.contains(&field.name.as_str()),
                "{} has two fields {}",
                stream.name,
                field.name
            );
            assert!(
                field.unless.iter().all(|flag| before.contains(flag)),
                "{} {}",
                stream.name,
                field.name
            );
        }
    }
}

#[test]
fn ellipsoids_have_the_fields_of_discs_except_those_that_sheets_or_harmonics_replace() {
    for machine in machines() {
        let names = |kind| -> Vec<String> {
            let all = constants(&machine, kind)
                .into_iter()
                .chain(streams(&machine, kind));
            all.flat_map(|stream| {
                stream
                    .fields
                    .into_iter()
                    .map(move |field| format!("{} {}", stream.name, field.name))
            })
            .collect()
        };
        let discs = names(Kind::default());
        for kind in kinds(&machine) {
            let here = names(kind);
            let gone: Vec<&String> = discs.iter().filter(|name| !here.contains(name)).collect();
            assert!(
                kind == Kind::default() || here != discs,
                "{kind:?} has what discs have"
            );
            let is_grouped = kind.sheets || kind.windows;
            let is_replaced = |name: &&&String| {
                is_grouped && name.starts_with("fragment.")
                    || kind.harmonics > 0
                        && ["red", "green", "blue"]
                            .iter()
                            .any(|channel| ***name == format!("pipeline.in {channel}"))
            };
            assert!(
                gone.iter().all(|name| is_replaced(&name)),
                "{kind:?} lacks {gone:?}"
            );
        }
    }
}

#[test]
fn results_of_setup_have_the_fields_of_their_records() {
    for machine in machines() {
        let width = |name: &str| {
            streams(&machine, Kind::default())
                .iter()
                .find(|stream| stream.name == name)
                .unwrap()
                .fields
                .len()
        };
        // Discs have no flag `transparent`.
        assert_eq!(width("project.out") + 1, crate::records::PROJECTED);
        assert_eq!(width("ellipse.out"), crate::records::SET_UP);
    }
}

#[test]
fn signals_parts_and_ports_belong_to_units_that_are_listed() {
    for machine in machines() {
        let signals = machine
            .signals
            .iter()
            .map(|signal| signal.unit)
            .filter(|unit| *unit != "splat");
        let parts = machine.parts.iter().map(|part| part.unit);
        let all = kinds(&machine)
            .into_iter()
            .flat_map(|kind| streams(&machine, kind));
        let ports: Vec<_> = all
            .filter_map(|stream| stream.unit())
            .filter(|unit| *unit != "pipeline")
            .collect();
        for name in parts {
            assert!(crate::records::unit::BUILT.contains(&name), "{name}");
        }
        for name in signals {
            assert!(crate::records::unit::WORDED.contains(&name), "{name}");
        }
        for name in ports {
            assert!(crate::records::unit::ALL.contains(&name), "{name}");
        }
    }
}
