use super::*;

fn machines() -> Vec<Elaborated> {
    Machine::NAMES.iter().map(|name| Machine::named(name).unwrap().elaborate().unwrap()).collect()
}

#[test]
fn records_have_the_widths_of_their_fields() {
    for machine in machines() {
        for stream in constants(&machine).into_iter().chain(streams(&machine)) {
            let places = stream.places();
            for (i, field) in stream.fields.iter().enumerate() {
                let top = if i == 0 { stream.width() } else { places[i - 1] };
                assert_eq!(places[i] + field.width(), top, "{} {}", stream.name, field.name);
            }
            assert_eq!(places.last(), Some(&0), "{}", stream.name);
        }
    }
}

#[test]
fn fields_have_names_of_their_own_and_depend_on_fields_before_them() {
    for machine in machines() {
        for stream in constants(&machine).into_iter().chain(streams(&machine)) {
            for (i, field) in stream.fields.iter().enumerate() {
                let before: Vec<&str> = stream.fields[..i].iter().map(|field| field.name.as_str()).collect();
                assert!(!before.contains(&field.name.as_str()), "{} has two fields {}", stream.name, field.name);
                assert!(field.unless.iter().all(|flag| before.contains(flag)), "{} {}", stream.name, field.name);
            }
        }
    }
}

#[test]
fn what_setup_makes_has_the_fields_of_its_records() {
    for machine in machines() {
        let width = |name: &str| streams(&machine).iter().find(|stream| stream.name == name).unwrap().fields.len();
        assert_eq!(width("project.out"), crate::probe::PROJECTED);
        assert_eq!(width("ellipse.out"), crate::probe::SET_UP);
    }
}
