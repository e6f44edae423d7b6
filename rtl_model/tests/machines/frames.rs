//! Small frames for any machine: a plausible scene in its words, in which any word may be replaced
//! by any other of its format.

use rtl_model::frame::{
    Amplitude, Aspect, Each, Ellipsoids, Frame, Kernel, Light, Lighting, Material, Orientation,
    Scaled, Sheets, Splat, View, Window,
};
use rtl_model::machine::{self, Interpolation, Machine};
use rtl_model::num::{Format, Word};

/// SplitMix64: small, and identical on all platforms.
pub struct Rng(pub u64);

impl Rng {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Draws words. One in `wildness` is any word of its format, most often an extreme.
struct Words {
    rng: Rng,
    wildness: u64,
}

impl Words {
    fn near(&mut self, word: Word, value: f64) -> i64 {
        if self.rng.below(self.wildness) == 0 {
            self.any(word.format)
        } else {
            nearest(word.format, value)
        }
    }

    fn between(&mut self, word: Word, low: f64, high: f64) -> i64 {
        let value = self.rng.between(low, high);
        self.near(word, value)
    }

    fn any(&mut self, format: Format) -> i64 {
        let word = match self.rng.below(6) {
            0 => format.min(),
            1 => format.max(),
            2 => self.rng.below(3) as i64 - 1,
            _ => {
                let magnitude = self.rng.next() as i64
                    >> (64 - format.width()).clamp(0, 63)
                    >> self.rng.below(format.width() as u64);
                if format.signed {
                    magnitude
                } else {
                    magnitude.abs()
                }
            }
        };
        word.clamp(format.min(), format.max())
    }

    fn scaled(&mut self, word: Word, value: f64) -> Scaled {
        let places = -(value.log2().floor() as i64) - 1;
        Scaled {
            mantissa: self.near(word, value * (places as f64).exp2()),
            places,
        }
    }
}

pub fn nearest(format: Format, value: f64) -> i64 {
    let word = value * f64::from(format.frac_bits).exp2();
    (word.round().clamp(-4e18, 4e18) as i64).clamp(format.min(), format.max())
}

/// A frame with a few splats: `wildness` 1 draws every word at random, a large number almost none.
pub fn frame(machine: &Machine, seed: u64, wildness: u64) -> Frame {
    let mut w = Words {
        rng: Rng(seed),
        wildness,
    };
    let [width, height] = [1 + w.rng.below(40) as u32, 1 + w.rng.below(40) as u32];
    let threshold = w.rng.between(0.05, 0.9);
    let lighting = lighting(machine, &mut w);
    let materials = lighting.materials.len() as u64;
    Frame {
        width,
        height,
        view: view(machine, width, &mut w),
        z_threshold: w.between(machine.fragment.depth, 0.0, 0.1),
        coverage_threshold: w.near(machine.fragment.weight_sum, threshold),
        inverse_threshold: w.scaled(machine.shade.inverse_threshold, 1.0 / threshold),
        background: std::array::from_fn(|_| w.between(machine.resolve.frame, 0.0, 1.0)),
        lighting,
        splats: (0..w.rng.below(40))
            .map(|_| splat(machine, materials, &mut w))
            .collect(),
        window: machine
            .fragment
            .window
            .map(|words| window(machine, &words, &mut w)),
        ..Frame::default()
    }
}

/// A frame of ellipsoids, grouped by sheets, on a machine that supports them.
pub fn ellipsoids(machine: &Machine, seed: u64, wildness: u64) -> Frame {
    let mut frame = frame(machine, seed, wildness);
    let mut w = Words {
        rng: Rng(seed ^ 0x5eed),
        wildness,
    };
    let (words, sheets) = (
        machine.ellipse.ellipsoid.unwrap(),
        machine.fragment.sheets.unwrap(),
    );
    let count = frame.splats.len();
    let axis =
        |w: &mut Words| std::array::from_fn(|_| w.between(machine.ellipse.normal, -1.0, 1.0));
    let own = (0..if w.rng.below(3) > 0 { count } else { 0 }).map(|_| Orientation {
        quaternion: std::array::from_fn(|_| w.between(words.quaternion, -0.7, 0.7) as i32),
        scales: std::array::from_fn(|_| w.between(words.scale, 0.0, 1.0) as i32),
    });
    let own = own.collect();
    let amplitudes = [
        Amplitude::Disc,
        Amplitude::LineIntegral,
        Amplitude::Peak,
        Amplitude::Compensated,
    ];
    let amplitude = amplitudes[w.rng.below(if words.compensation_root.is_some() {
        4
    } else {
        3
    }) as usize];
    let reach = words
        .reach_bits
        .filter(|_| w.rng.below(4) > 0)
        .map_or(0, |bits| 1 << bits);
    let harmonics = machine
        .colour
        .map_or(0, |colour| w.rng.below(u64::from(colour.degree) + 1) as u8);
    frame.ellipsoids = Some(Ellipsoids {
        kernel: Kernel {
            amplitude,
            jacobian: std::array::from_fn(|_| w.near(machine.project.slope, 1.0)),
            axes: std::array::from_fn(|_| axis(&mut w)),
            scales: std::array::from_fn(|_| w.between(words.scale, 0.0, 1.0)),
            least_opacity: if w.rng.below(2) == 0 {
                w.between(machine.splat.opacity, 0.0, 0.2)
            } else {
                0
            },
            reach: (0..reach)
                .map(|_| w.between(machine.raster.cutoff, 0.1, 4.0).max(1))
                .collect(),
            inverse_distance: Scaled::default(),
        },
        own,
        preshaded: w.rng.below(2) == 0,
        sorted: machine.sorting().is_some(),
        harmonics,
        coefficients: Vec::new(),
    });
    // After the other random numbers, so that the rest of the frame does not change.
    let mut of_colour = Words {
        rng: Rng(!w.rng.0),
        wildness,
    };
    if let (Some(words), Some(ellipsoids)) = (machine.depth_weight(), &mut frame.ellipsoids) {
        // Splats are up to 0.7 in front of the eye.
        let inverse = of_colour.rng.between(0.5, 5.0);
        ellipsoids.kernel.inverse_distance = of_colour.scaled(words.share, inverse);
    }
    let of_degree = (usize::from(harmonics) + 1).pow(2);
    let words = machine.colour.filter(|_| harmonics > 0);
    if let (Some(words), Some(ellipsoids)) = (words, &mut frame.ellipsoids) {
        ellipsoids.coefficients = (0..count * of_degree)
            .map(|_| {
                std::array::from_fn(|_| of_colour.between(words.coefficient, -1.0, 1.0) as i32)
            })
            .collect();
    }
    let weight = machine.gauss.weight;
    let ratio = if w.rng.below(4) > 0 {
        (1 << sheets.table.index_bits) + 1
    } else {
        0
    };
    frame.sheets = (w.rng.below(4) > 0).then(|| Sheets {
        each: if w.rng.below(2) == 0 {
            Each::Slice
        } else {
            Each::Splat
        },
        numbers: (0..count as u32).map(|number| number / 4).collect(),
        back_to_front: w.rng.below(3) == 0,
        stop: w.near(machine.fragment.opacity_sum, 0.01),
        keeps_last: w.rng.below(2) == 0,
        least_weight: w.near(weight, 0.004),
        most_weight: w.near(weight, 0.99),
        ratio: (0..ratio)
            .map(|_| w.between(sheets.ratio, 0.1, 1.0))
            .collect(),
    });
    frame
}

fn window(machine: &Machine, words: &machine::Window, w: &mut Words) -> Window {
    let entries = |shape: machine::TableShape| {
        (1usize << shape.index_bits) + usize::from(shape.interpolation == Interpolation::Linear)
    };
    let (densities, hidden) = (entries(words.density_table), entries(words.hidden_table));
    Window {
        reach: w.between(machine.fragment.depth, 0.0, 0.05),
        density: (0..densities)
            .map(|i| w.near(words.density, 6.0 * i as f64 / densities as f64))
            .collect(),
        hidden: (0..hidden)
            .map(|i| w.near(words.hidden, i as f64 / hidden as f64))
            .collect(),
    }
}

fn view(machine: &Machine, width: u32, w: &mut Words) -> View {
    let (p, e) = (&machine.project, &machine.ellipse);
    let focal = w.rng.between(0.5, 3.0) * f64::from(width);
    let cutoff = w.rng.between(0.5, 4.0);
    // Separate random numbers, so that the rest of the frame does not change.
    let mut lens = Words {
        rng: Rng(!w.rng.0),
        wildness: w.wildness,
    };
    View {
        rotation: std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let tilt = w.rng.between(-0.2, 0.2);
                w.near(p.rotation, if row == column { 0.98 } else { tilt })
            })
        }),
        eye: [0.0, 0.0, -0.4].map(|v| w.near(p.eye, v)),
        near: w.near(p.depth, 0.01),
        guard: std::array::from_fn(|_| w.near(p.slope, 1.0)),
        focal: w.near(p.focal, focal),
        inverse_focal: w.scaled(e.inverse_focal, 1.0 / focal),
        centre: std::array::from_fn(|_| lens.near(p.pixel, 0.0)),
        aspect: e
            .aspect
            .filter(|_| lens.rng.below(2) == 0)
            .map(|word| aspect(p.focal, e.inverse_focal, word, focal, &mut lens)),
        low_pass: w.near(e.low_pass, 1.0),
        cutoff: w.near(machine.raster.cutoff, cutoff),
        root_cutoff: w.near(e.root_cutoff, cutoff.sqrt()),
        cull_backfaces: w.rng.below(4) == 0,
    }
}

/// Pixels up to three times as wide as high, or the reverse.
fn aspect(focal_word: Word, inverse: Word, square: Word, focal: f64, w: &mut Words) -> Aspect {
    let ratio = w.rng.between(0.3, 1.0);
    let focals = if w.rng.below(2) == 0 {
        [focal, ratio * focal]
    } else {
        [ratio * focal, focal]
    };
    Aspect {
        focal: focals.map(|focal| w.near(focal_word, focal)),
        inverse_focal: focals.map(|focal| w.scaled(inverse, 1.0 / focal)),
        squares: [[0, 0], [0, 1], [1, 1]]
            .map(|[i, j]| w.near(square, focals[i] * focals[j] / (focal * focal))),
    }
}

fn splat(machine: &Machine, materials: u64, w: &mut Words) -> Splat {
    let s = &machine.splat;
    let normal: [f64; 3] = std::array::from_fn(|_| w.rng.between(-1.0, 1.0));
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt().max(1e-6);
    let size = w.rng.between(-9.0, -1.0).exp2();
    Splat {
        position: std::array::from_fn(|_| w.between(s.position, -0.3, 0.3) as i32),
        normal: normal.map(|n| w.near(s.normal, n / length) as i32),
        radius: w.near(s.radius, size) as i32,
        rgb: std::array::from_fn(|_| w.between(s.rgb, 0.0, 1.0) as i32),
        opacity: if w.rng.below(2) == 0 {
            w.near(s.opacity, 1.0) as i32
        } else {
            w.between(s.opacity, 0.0, 1.0) as i32
        },
        material: w.rng.below(materials) as u32,
    }
}

fn lighting(machine: &Machine, w: &mut Words) -> Lighting {
    let s = &machine.shade;
    let lights: Vec<Light> = (0..w.rng.below(4))
        .map(|_| Light {
            direction: std::array::from_fn(|_| w.between(s.light, -1.0, 1.0)),
            half_way: (w.rng.below(4) > 0)
                .then(|| std::array::from_fn(|_| w.between(s.light, -1.0, 1.0))),
        })
        .collect();
    let steps = 1usize << s.highlight_table.index_bits;
    let count = steps + usize::from(s.highlight_table.interpolation == Interpolation::Linear);
    let shiny = |w: &mut Words| {
        let constants = |w: &mut Words| {
            lights
                .iter()
                .map(|_| std::array::from_fn(|_| w.between(s.reflectance, 0.0, 1.0)))
                .collect()
        };
        Material::BlinnPhong {
            ambient: w.between(s.reflectance, 0.0, 0.5),
            diffuse: constants(w),
            specular: constants(w),
            highlight: (0..count)
                .map(|i| w.near(s.highlight, (i as f64 / steps as f64).powi(8)))
                .collect(),
        }
    };
    let materials = vec![Material::Unlit, shiny(w), shiny(w)];
    Lighting { lights, materials }
}

/// Those of sixteen pixels from `corner` that are between the first and the last, counted from the
/// corner.
pub fn in_tile([first, last]: [u16; 2], corner: u16) -> std::ops::Range<usize> {
    let inside: Vec<usize> = (0..16)
        .filter(|at| (usize::from(first)..=usize::from(last)).contains(&(usize::from(corner) + at)))
        .collect();
    inside
        .first()
        .map_or(0..0, |from| *from..from + inside.len())
}
