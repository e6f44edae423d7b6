//! Map: laws of light between texels.

use super::*;
use crate::probe::NoProbe;
use proptest::prelude::*;

fn map(index_bits: u32, place_bits: i32, fraction_bits: i32, light_bits: i32) -> Map {
    let word = |frac_bits: i32| Word::new(Format::unsigned(1, frac_bits));
    let words = Words {
        index_bits,
        place_bits,
        fraction: word(fraction_bits),
        light: word(light_bits),
        cached: None,
    };
    let e = &mut Elaboration::default();
    let map = Map::new(e, crate::records::unit::REFLECT, words);
    assert_eq!(e.errors, Vec::<String>::new());
    map
}

proptest! {
    #[test]
    fn corners_are_texels(index_bits in 1u32..=5, fraction_bits in 0i32..=8, texels in prop::collection::vec(0i64..=256, 1024)) {
        let (map, probe) = (map(index_bits, 12, fraction_bits, 8), &mut NoProbe);
        let tap = &mut Tap::new(probe);
        let texels: Vec<[i64; 3]> = texels.into_iter().map(|texel| [texel; 3]).collect();
        let last = map.side() - 1;
        for (place, texel) in [([0, 0], 0), ([4096, 0], last), ([0, 4096], last * map.side()), ([4096; 2], last * map.side() + last)] {
            prop_assert_eq!(map.light(&texels, place, tap), texels[texel]);
        }
    }

    #[test]
    fn light_lies_among_its_texels(
        index_bits in 1u32..=4, fraction_bits in 0i32..=8, place in prop::array::uniform2(0i64..=4096),
        texels in prop::collection::vec(0i64..=256, 256),
    ) {
        let (map, probe) = (map(index_bits, 12, fraction_bits, 8), &mut NoProbe);
        let tap = &mut Tap::new(probe);
        let texels: Vec<[i64; 3]> = texels.into_iter().map(|texel| [texel; 3]).collect();
        let steps = (map.side() - 1) as f64;
        // The step by its definition, not by its bits.
        let [column, row] = place.map(|place| ((place as f64 / 4096.0 * steps).floor() as usize).min(map.side() - 2));
        let met: Vec<i64> = [0, 1].iter().flat_map(|down| [0, 1].map(|right| texels[(row + down) * map.side() + column + right][0])).collect();
        let [light, ..] = map.light(&texels, place, tap);
        prop_assert!(met.iter().min() <= Some(&light) && Some(&light) <= met.iter().max(), "{:?}: {}", met, light);
    }
}
