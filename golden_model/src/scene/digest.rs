//! Digest: computes the SHA-256 of a text, or of everything in a scene that is drawn.

use super::tree::cut::DetailRules;
use super::{
    Camera, Ellipsoids, Filter, Harmonics, Kernel, Orientation, Scene, Sheet, Sheets, Splat,
};
use crate::output::text::hex;
use sha2::{Digest, Sha256};

/// Hexadecimal digits of the first bytes of a SHA-256.
pub fn digest(text: &[u8]) -> String {
    hex(&Sha256::digest(text)[..12])
}

/// A digest of everything in a scene that is drawn.
pub fn digest_of(scene: &Scene) -> String {
    // Destructured by field, here and below, so that a new field cannot be forgotten.
    let Scene {
        // Name and notes are not drawn.
        name: _,
        notes: _,
        splats,
        camera,
        image,
        kernel,
        ellipsoids,
        sheets,
        surface,
        lights,
        materials,
        environment,
        // The splats are the cut of a tree; `ideal` draws the whole tree.
        detail,
        path: _,
    } = scene;
    let mut sha = Sha256::new();
    let Kernel {
        cutoff,
        low_pass,
        guard,
        jacobian,
        filter,
        compensate_opacity,
    } = kernel;
    let mut kernel = format!(
        "Kernel {{ cutoff: {cutoff:?}, low_pass: {low_pass:?}, guard: {guard:?}, jacobian: {jacobian:?} }}"
    );
    if *compensate_opacity {
        kernel += "compensated";
    }
    // The default filter is not written: scenes keep their digests.
    if *filter != Filter::Ewa {
        kernel += &format!("{filter:?}");
    }
    let Camera {
        eye,
        target,
        up,
        fov_y_degrees,
        near,
        focal_px,
        centre_px,
        picture_px,
    } = camera;
    let angle = format!("fov_y_degrees: {fov_y_degrees:?}");
    let mut camera = format!(
        "Camera {{ eye: {eye:?}, target: {target:?}, up: {up:?}, {angle}, near: {near:?} }}"
    );
    // A frame after others can depend on them.
    if !scene.cameras_before().is_empty() {
        camera += &format!("{:?}", scene.path);
    }
    if focal_px.or(*centre_px).is_some() {
        camera += &format!("{focal_px:?}{centre_px:?}{picture_px:?}");
    }
    sha.update(format!(
        "{camera}{image:?}{kernel}{surface:?}{lights:?}{materials:?}"
    ));
    if let Some(Ellipsoids {
        orientations,
        amplitude,
        preshaded,
        sorted,
        harmonics,
    }) = ellipsoids
    {
        sha.update(format!("{amplitude:?}{preshaded}{sorted}"));
        if let Some(Harmonics {
            degree,
            turn,
            coefficients,
        }) = harmonics
        {
            sha.update([*degree]);
            add(&mut sha, &turn.to_array());
            for coefficient in coefficients.as_flattened() {
                sha.update(coefficient.to_le_bytes());
            }
        }
        for Orientation { rotation, scales } in orientations {
            add(
                &mut sha,
                &[rotation.to_array().as_slice(), scales.to_array().as_slice()].concat(),
            );
        }
    }
    if let Some(Sheets {
        of,
        back_to_front,
        opacity,
        stop,
        keeps_last,
        least_weight,
        most_weight,
        weight_distance,
    }) = sheets
    {
        let numbers: &[u32] = if let Sheet::Slice(numbers) = of {
            numbers
        } else {
            &[]
        };
        numbers
            .iter()
            .for_each(|number| sha.update(number.to_le_bytes()));
        sha.update(format!(
            "{back_to_front}{opacity:?}{stop}{keeps_last}{least_weight}{most_weight}"
        ));
        // Scenes without it keep their digests.
        if let Some(distance) = weight_distance {
            sha.update(format!("distance: {distance:?}"));
        }
    }
    if let Some(environment) = environment {
        sha.update(environment.bytes().collect::<Vec<u8>>());
    }
    let mut add_splat = |Splat {
                             position,
                             normal,
                             radius,
                             rgb,
                             opacity,
                             material,
                         }: &Splat| {
        let numbers = [
            position.to_array(),
            normal.to_array(),
            *rgb,
            [*radius, *opacity, (*material).into()],
        ];
        add(&mut sha, numbers.as_flattened());
    };
    splats.iter().for_each(&mut add_splat);
    // Scenes without a tree keep their digests.
    if let Some(detail) = detail {
        detail
            .tree
            .nodes()
            .iter()
            .for_each(|node| add_splat(&node.splat));
        let visits = &detail.cut.visits;
        let DetailRules {
            pixels,
            order,
            culls,
            ahead,
            budget,
        } = detail.rules;
        sha.update(format!(
            "Rules {{ pixels: {pixels:?}, order: {order:?}, culls: {culls:?}, ahead: {ahead:?}, budget: {budget:?} }}"
        ));
        visits
            .iter()
            .for_each(|visit| sha.update(visit.node.to_le_bytes()));
    }
    hex(&sha.finalize())
}

/// A digest of the positions and sizes of a scene's splats. It does not depend on camera, size,
/// light or order, because a camera may change order, normals and colours.
pub fn digest_of_places(scene: &Scene) -> String {
    let number = |number: u64, value: f64| mixed(number ^ value.to_bits());
    let of_one = |splat: &Splat| {
        splat
            .position
            .to_array()
            .into_iter()
            .chain([splat.radius])
            .fold(0, number)
    };
    // For a tree: all leaves, independent of the cut.
    let leaves = scene.detail.as_ref().map(|detail| detail.tree.splats());
    let splats = leaves.as_ref().unwrap_or(&scene.splats);
    let sums = splats
        .iter()
        .map(of_one)
        .fold([0u64; 2], |[sum, mix], one| {
            [sum.wrapping_add(one), mix.wrapping_add(mixed(!one))]
        });
    digest(
        &[
            sums[0].to_le_bytes(),
            sums[1].to_le_bytes(),
            (splats.len() as u64).to_le_bytes(),
        ]
        .concat(),
    )
}

/// SplitMix64 of a number.
pub fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn add(sha: &mut Sha256, numbers: &[f64]) {
    numbers
        .iter()
        .for_each(|number| sha.update(number.to_le_bytes()));
}
