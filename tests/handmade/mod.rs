//! Handmade: small scenes for laws, and numbers for generating them.
#![allow(dead_code, reason = "each test file uses some of it")]

use glam::DVec3;
use splatsim::scene::{Camera, Filter, Image, Kernel, Light, Material, Scene, Splat, Surface};

/// A scene of discs with about `splats` of them: every n-th one, enlarged, so that as many overlap in
/// a pixel and fewer are set up.
pub fn thinned(mut scene: Scene, splats: usize) -> Scene {
    let every = scene.splats.len() / splats + 1;
    scene.splats = scene.splats.iter().step_by(every).copied().collect();
    let wider = (every as f64).sqrt();
    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.radius *= wider);
    scene
}

/// A scene seen along +z, x right, y down, with `s` pixels per unit of `t_x/t_z`; black transparent
/// background.
pub fn scene(width: usize, height: usize, s: f64, splats: Vec<Splat>) -> Scene {
    Scene {
        name: "test".into(),
        splats,
        camera: Camera {
            eye: DVec3::ZERO,
            target: DVec3::Z,
            up: DVec3::NEG_Y,
            fov_y_degrees: 2.0 * (height as f64 / 2.0 / s).atan().to_degrees(),
            near: 0.01,
            focal_px: None,
            centre_px: None,
            picture_px: None,
        },
        image: Image {
            width,
            height,
            background: [0.0; 4],
            encoded: false,
        },
        kernel: Kernel {
            cutoff: 2.0,
            low_pass: 1.0,
            guard: 1.5,
            jacobian: 1.3,
            filter: Filter::Ewa,
            compensate_opacity: false,
        },
        ellipsoids: None,
        sheets: None,
        surface: Surface {
            z_threshold: 0.05,
            coverage_threshold: 0.4,
            cull_backfaces: false,
        },
        lights: Vec::new(),
        materials: vec![Material::Unlit],
        environment: None,
        detail: None,
        path: None,
        notes: Vec::new(),
    }
}

/// White, opaque, facing the eye.
pub fn splat(position: [f64; 3], radius: f64) -> Splat {
    let position = DVec3::from_array(position);
    Splat {
        position,
        normal: DVec3::NEG_Z,
        radius,
        rgb: [1.0; 3],
        opacity: 1.0,
        material: 0,
    }
}

/// Numbers in [0, 1) from a 64-bit linear congruential generator.
pub struct Rng(pub u64);

impl Rng {
    pub fn roll(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn within(&mut self, reach: f64) -> f64 {
        reach * (2.0 * self.roll() - 1.0)
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.within(1.0), self.within(1.0), self.within(1.0));
            if (0.01..1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }

    pub fn shuffle(&mut self, splats: &mut [Splat]) {
        for last in (1..splats.len()).rev() {
            splats.swap(last, (self.roll() * (last + 1) as f64) as usize);
        }
    }
}

/// Coloured, half-transparent, tilted, lit splats anywhere in the view of a 40×24 picture.
pub fn confetti(count: usize, seed: u64) -> Scene {
    let mut rng = Rng(seed);
    let splats = (0..count).map(|_| {
        let z = 1.0 + rng.roll();
        Splat {
            position: DVec3::new(z * rng.within(0.6), z * rng.within(0.4), z),
            normal: DVec3::new(rng.within(1.0), rng.within(1.0), -1.0).normalize(),
            radius: 0.01 + 0.2 * rng.roll(),
            rgb: [rng.roll(), rng.roll(), rng.roll()],
            opacity: rng.roll(),
            material: (rng.roll() * 2.0) as u32,
        }
    });
    let mut scene = scene(40, 24, 40.0, splats.collect());
    scene.lights = vec![Light {
        direction: DVec3::new(0.3, -0.5, -0.8).normalize(),
        rgb: [0.9, 1.0, 0.8],
    }];
    scene.materials.push(Material::BlinnPhong {
        ambient: 0.1,
        diffuse: 0.7,
        specular: 0.4,
        shininess: 20.0,
    });
    scene.image.background = [0.2, 0.4, 0.6, 0.5];
    scene
}

/// `sheets` glass sheets 2ε apart, each rougher than a plane but thinner than ε, in random order.
pub fn glass(sheets: usize, seed: u64) -> Scene {
    let mut rng = Rng(seed);
    let splats = (0..2000).map(|index| {
        let sheet = 1.0 + 0.1 * (index % sheets) as f64;
        let position = [rng.within(0.6), rng.within(0.4), sheet + rng.within(0.01)];
        let normal = DVec3::new(rng.within(0.3), rng.within(0.3), -1.0).normalize();
        let rgb = [rng.roll(), rng.roll(), rng.roll()];
        Splat {
            normal,
            rgb,
            opacity: 0.5 * rng.roll(),
            ..splat(position, 0.008)
        }
    });
    let mut scene = scene(40, 24, 40.0, splats.collect());
    rng.shuffle(&mut scene.splats);
    scene
}
