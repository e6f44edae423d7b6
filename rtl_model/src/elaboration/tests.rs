use crate::elaboration::Part;
use crate::machine::Machine;

#[test]
fn what_setup_multiplies_is_what_it_declares() {
    for name in Machine::NAMES {
        let file = Machine::named(name).unwrap();
        let machine = file.elaborate().unwrap();
        let declared = |unit: &str| machine.parts.iter().filter(|part| part.unit == unit).map(Part::products).sum::<u32>();
        assert_eq!(machine.project.graph().products(), declared("project"), "{name}");
        let disc = machine.ellipse.variant(file.ellipse.aspect.is_some(), None);
        assert_eq!(machine.ellipse.datapath(disc).graph.products(), declared("ellipse"), "{name}");
    }
}

/// A wider digit saves a pass and is paid for: two counts for each of its values.
#[test]
fn counts_of_digits_are_memory() {
    let bits = |digit_bits| {
        let mut machine = Machine::named("gaussian").unwrap();
        machine.sort.iter_mut().for_each(|sort| sort.digit_bits = digit_bits);
        machine.elaborate().unwrap().timing.storage.memory_bits
    };
    assert_eq!(bits(16) - bits(8), 2 * 32 * (65_536 - 256));
    assert_eq!(bits(9) - bits(8), 2 * 32 * 256);
    let without = Machine { sort: None, ..Machine::named("gaussian").unwrap() };
    assert_eq!(bits(8) - without.elaborate().unwrap().timing.storage.memory_bits, 2 * 32 * 256);
}
