//! Constants: registers, lights and materials of a frame as records.

use rtl_model::frame::{Amplitude, Each, Ellipsoids, Frame, Material, Scaled, Sheets};
use rtl_model::machine::Machine;

/// The constants of a frame as records, stream by stream.
pub fn constants(machine: &Machine, frame: &Frame) -> Vec<(&'static str, Vec<Vec<i64>>)> {
    let v = &frame.view;
    let mut words = vec![i64::from(frame.width), i64::from(frame.height)];
    words.extend(v.rotation.as_flattened());
    words.extend(v.eye);
    words.push(v.near);
    words.extend(v.guard);
    words.extend([
        v.focal,
        v.inverse_focal.mantissa,
        v.inverse_focal.places,
        v.low_pass,
        v.cutoff,
        v.root_cutoff,
    ]);
    words.extend(v.centre);
    if let Some(aspect) = machine.ellipse.aspect {
        words.extend(v.focals());
        words.extend(
            v.inverse_focals()
                .into_iter()
                .flat_map(|Scaled { mantissa, places }| [mantissa, places]),
        );
        words.extend(v.squares(aspect.format.one()));
    }
    words.extend([
        v.cull_backfaces.into(),
        frame.z_threshold,
        frame.coverage_threshold,
    ]);
    words.extend([
        frame.inverse_threshold.mantissa,
        frame.inverse_threshold.places,
    ]);
    words.extend(frame.background);
    words.extend(frame.ellipsoids.iter().flat_map(|of| kernel(machine, of)));
    words.extend(frame.sheets.iter().flat_map(registers));
    words.extend(frame.window.iter().map(|window| window.reach));
    let lights = frame.lighting.lights.iter().map(|light| {
        let half_way = light.half_way;
        [
            &light.direction[..],
            &[half_way.is_some().into()],
            &half_way.unwrap_or_default(),
        ]
        .concat()
    });
    let materials = frame
        .lighting
        .materials
        .iter()
        .enumerate()
        .map(|(number, material)| {
            let lit = match material {
                Material::Unlit => [1, 0],
                Material::BlinnPhong { ambient, .. } => [0, *ambient],
            };
            let mirror = frame
                .surroundings
                .as_ref()
                .map(|surroundings| surroundings.mirrors[number]);
            lit.into_iter()
                .chain(
                    mirror
                        .into_iter()
                        .flat_map(|mirror| [mirror.kept].into_iter().chain(mirror.mirrored)),
                )
                .collect()
        });
    let count = frame.lighting.lights.len();
    let reflections = frame.lighting.materials.iter().flat_map(|material| {
        (0..count).map(move |light| match material {
            Material::Unlit => vec![0; 6],
            Material::BlinnPhong {
                diffuse, specular, ..
            } => [diffuse[light], specular[light]].concat(),
        })
    });
    vec![
        ("frame", vec![words]),
        ("light", lights.collect()),
        ("material", materials.collect()),
        ("reflection", reflections.collect()),
    ]
}

/// Words of the constants of all ellipsoids.
fn kernel(machine: &Machine, ellipsoids: &Ellipsoids) -> Vec<i64> {
    let kernel = &ellipsoids.kernel;
    let amplitude = match kernel.amplitude {
        Amplitude::Disc => 0,
        Amplitude::LineIntegral => 1,
        Amplitude::Peak => 2,
        Amplitude::Compensated => 3,
    };
    let [preshaded, own] = [ellipsoids.preshaded, !ellipsoids.own.is_empty()].map(i64::from);
    let Scaled { mantissa, places } = kernel.inverse_distance;
    let inverse_distance = [mantissa, places];
    let of_weights = machine.depth_weight().map_or(0, |_| inverse_distance.len());
    [
        &[amplitude, preshaded, own],
        &kernel.jacobian[..],
        kernel.axes.as_flattened(),
        &kernel.scales,
        &[kernel.least_opacity],
        &inverse_distance[..of_weights],
    ]
    .concat()
}

/// Words of the constants of all sheets.
fn registers(sheets: &Sheets) -> Vec<i64> {
    let Sheets {
        each,
        back_to_front,
        stop,
        keeps_last,
        least_weight,
        most_weight,
        ratio,
        ..
    } = sheets;
    let each_splat = *each == Each::Splat;
    let natural = |flag: bool| i64::from(flag);
    vec![
        natural(each_splat),
        natural(*back_to_front),
        *stop,
        natural(*keeps_last),
        *least_weight,
        *most_weight,
        natural(!ratio.is_empty()),
    ]
}
