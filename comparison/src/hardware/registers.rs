//! Registers: the machine's input words, each with the exact number that it represents.
//!
//! ```text
//! exact number ─┬─►[ hold ]─► a bound on both (lockstep), or one of the two (mixed precision)
//! held word ────┘
//! ```
//! Every word has the name of its field in the machine's description.

use crate::golden::shade::Shader;
use crate::golden::window_density;
use crate::hardware::fixed;
use crate::hardware::quantise::{Quantised, limited_cutoff, quantised as constant};
use crate::scene;
use crate::scene::{Opacity, Scene, Sheets, View};
use glam::{DMat3, DQuat, DVec3};
use rtl_model::frame::{self, Scaled};
use rtl_model::machine::Group;
use rtl_model::num::Word;
use rtl_model::pipeline::Elaborated;
use rtl_model::real::frame as real;
use rtl_model::real::frame::{Ellipsoid, Orientation, Splat};
use rtl_model::real::{MixedPrecision, Near, Real, Switches};
use rtl_model::units::fragment;
use rtl_model::units::fragment::sheets::real::Ratio;
use rtl_model::units::fragment::window::WindowRegisters;
use rtl_model::units::fragment::window::real::Tables;
use rtl_model::units::shade::real::{Light, Lighting, Material};
use rtl_model::units::shade::reflect::real::{Mirror, Surroundings};
use std::borrow::Cow;
use std::f64::consts::TAU;

/// Input words of the machine: the splat's record, and the registers of a frame.
pub const INPUTS: [&str; 32] = [
    "splat.position",
    "splat.normal",
    "splat.radius",
    "splat.rgb",
    "splat.opacity",
    "project.eye",
    "project.rotation",
    "project.depth",
    "project.slope",
    "project.focal",
    "project.pixel",
    "ellipse.inverse_focal",
    "ellipse.aspect",
    "ellipse.low_pass",
    "ellipse.root_cutoff",
    "ellipse.inverse_two_pi",
    "ellipse.normal",
    "ellipse.quaternion",
    "ellipse.scale",
    "colour.coefficient",
    "sort.share",
    "raster.cutoff",
    "gauss.weight",
    "fragment.depth",
    "fragment.weight_sum",
    "fragment.opaque",
    "fragment.opacity_sum",
    "shade.light",
    "shade.reflectance",
    "shade.inverse_threshold",
    "reflect.reflectance",
    "resolve.frame",
];

/// Makes one wire from an exact number and its word.
pub trait Hold {
    /// A number on a wire.
    type Real: Real;
    /// Wire for the word with this name.
    fn hold(&self, name: &'static str, value: f64, word: Word, held: i64) -> Self::Real;
    /// Wire for a mantissa and a power of two.
    fn hold_scaled(&self, name: &'static str, value: f64, word: Word, held: Scaled) -> Self::Real;
}

/// The exact number, with a bound on its distance from the word.
pub struct Bounded;

impl Hold for Bounded {
    type Real = Near;

    fn hold(&self, _name: &'static str, value: f64, word: Word, held: i64) -> Near {
        Near::held(value, word, held)
    }

    fn hold_scaled(&self, _name: &'static str, value: f64, word: Word, held: Scaled) -> Near {
        Near::held_scaled(value, word, held)
    }
}

/// The word for the chosen inputs, else the exact number.
pub struct Chosen<'a> {
    /// Names of words.
    pub inputs: &'a [&'static str],
    /// Signals that are words.
    pub switches: &'a Switches,
}

impl<'a> Hold for Chosen<'a> {
    type Real = MixedPrecision<'a>;

    fn hold(&self, name: &'static str, value: f64, word: Word, held: i64) -> MixedPrecision<'a> {
        let value = if self.inputs.contains(&name) {
            word.format.value(held)
        } else {
            value
        };
        MixedPrecision::new(value, self.switches)
    }

    fn hold_scaled(
        &self,
        name: &'static str,
        value: f64,
        word: Word,
        held: Scaled,
    ) -> MixedPrecision<'a> {
        let Scaled { mantissa, places } = held;
        let value = if self.inputs.contains(&name) {
            word.format.value(mantissa) * (-(places as f64)).exp2()
        } else {
            value
        };
        MixedPrecision::new(value, self.switches)
    }
}

/// A scene and its words on a machine.
#[derive(Clone, Copy, Debug)]
pub struct Registers<'a> {
    /// Exact.
    pub scene: &'a Scene,
    /// Exact.
    pub eye: &'a View,
    /// Machine of the words.
    pub machine: &'a Elaborated,
    /// Words.
    pub quantised: &'a Quantised,
}

/// Registers of sheets, and the function in their table.
pub struct SheetWords<'a, R> {
    /// Exact.
    pub sheets: Cow<'a, Sheets>,
    /// The machine draws the deepest sheet first.
    pub back_to_front: bool,
    /// Words of the machine.
    pub registers: fragment::sheets::SheetRegisters<'a>,
    /// α/x.
    pub ratio: Ratio,
    /// A pixel that lets less through accepts no more contributions.
    pub stop: R,
    /// Limit of a weight, where each splat is a sheet.
    pub most_weight: R,
    /// Smaller weights make no fragment.
    pub least_weight: R,
}

impl<'a, R> SheetWords<'a, R> {
    /// `None` where fragments are grouped by depth.
    pub fn new<H: Hold<Real = R>>(
        hold: &H,
        scene: &'a Scene,
        machine: &Elaborated,
        quantised: &'a Quantised,
    ) -> Option<Self> {
        let held = quantised.frame.sheets.as_ref()?;
        let sheets = scene.sheets_for(machine.machine.sums_gaussians())?;
        let (weight, opacity) = (
            machine.machine.gauss.weight,
            machine.machine.fragment.opacity_sum,
        );
        Some(SheetWords {
            back_to_front: held.back_to_front,
            registers: machine.fragment.sheets(held),
            ratio: match sheets.opacity {
                // 1/x beyond 1, whose second derivative is 2/x³.
                Opacity::Linear => Ratio {
                    exact: |depth| Opacity::Linear.over_depth(depth),
                    curves: |_| [1.0, 2.0],
                },
                Opacity::Exponential => Ratio {
                    exact: |depth| Opacity::Exponential.over_depth(depth),
                    curves: |_| [0.5, 1.0 / 3.0],
                },
                // 1/(1 + x), whose derivatives are −1/(1 + x)² and 2/(1 + x)³.
                Opacity::Weighted => Ratio {
                    exact: |depth| Opacity::Weighted.over_depth(depth),
                    curves: |x| {
                        let ratio = Opacity::Weighted.over_depth(x);
                        [ratio * ratio, 2.0 * ratio * ratio * ratio]
                    },
                },
            },
            stop: hold.hold("fragment.opacity_sum", sheets.stop, opacity, held.stop),
            most_weight: hold.hold("gauss.weight", sheets.most_weight, weight, held.most_weight),
            least_weight: hold.hold(
                "gauss.weight",
                sheets.least_weight,
                weight,
                held.least_weight,
            ),
            sheets,
        })
    }
}

/// Registers of windows, and the functions in their tables.
pub struct WindowWords<R> {
    /// Words of the machine.
    pub registers: WindowRegisters,
    /// Functions in their tables.
    pub tables: Tables,
    /// Limit of a cluster's width for a contribution to join it, machine units.
    pub reach: R,
}

impl<R> WindowWords<R> {
    /// `None` where fragments are not grouped by intervals or windows.
    pub fn new<H: Hold<Real = R>>(
        hold: &H,
        scene: &Scene,
        machine: &Elaborated,
        quantised: &Quantised,
    ) -> Option<Self> {
        let registers = machine.windows(&quantised.frame)?;
        let words = &machine.machine;
        let join = words.fragment.window.as_ref()?.join_permille;
        // Intervals join within ε.
        let (part, held) = match words.fragment.group {
            Group::Interval => (1.0, quantised.frame.z_threshold),
            _ => (f64::from(join) / 1000.0, registers.reach),
        };
        let exact = part * scene.surface.z_threshold * quantised.scale.factor();
        let opacity_range = f64::from(words.splat.opacity.format.int_bits).exp2();
        Some(WindowWords {
            tables: Tables::new(&registers, opacity_range, window_density),
            reach: hold.hold("fragment.depth", exact, words.fragment.depth, held),
            registers,
        })
    }
}

fn vector<H: Hold>(
    hold: &H,
    name: &'static str,
    value: DVec3,
    word: Word,
    held: [i64; 3],
) -> [H::Real; 3] {
    [0, 1, 2].map(|axis| hold.hold(name, value[axis], word, held[axis]))
}

impl Registers<'_> {
    /// The viewing registers; lengths in machine units.
    pub fn view<H: Hold>(&self, hold: &H) -> real::View<H::Real> {
        let Registers {
            scene,
            eye: view,
            machine,
            quantised,
        } = self;
        let (p, e, raster) = (
            &machine.machine.project,
            &machine.machine.ellipse,
            &machine.machine.raster,
        );
        let (held, scale) = (&quantised.frame.view, &quantised.scale);
        let (kernel, near) = (&scene.kernel, scene.camera.near * scale.factor());
        let cutoff = limited_cutoff(&machine.machine, scene);
        let guard = |axis: usize| {
            hold.hold(
                "project.slope",
                view.slope(axis, kernel.guard),
                p.slope,
                held.guard[axis],
            )
        };
        let (focals, focal_px) = (held.focals(), view.longest_focal_px());
        let squares = view.aspect().zip(held.aspect).zip(e.aspect);
        real::View {
            rotation: [0, 1, 2].map(|row| {
                vector(
                    hold,
                    "project.rotation",
                    view.rotation.row(row),
                    p.rotation,
                    held.rotation[row],
                )
            }),
            eye: self.eye_word(hold),
            near: hold.hold("project.depth", near, p.depth, held.near),
            guard: [guard(0), guard(1)],
            focal: hold.hold("project.focal", focal_px, p.focal, held.focal),
            focals: [0, 1]
                .map(|axis| hold.hold("project.focal", view.focal_px[axis], p.focal, focals[axis])),
            inverse_focals: self.inverse_focals(hold),
            centre: self.centre(hold),
            aspect: squares.map(|((exact, held), word)| {
                [0, 1, 2].map(|i| hold.hold("ellipse.aspect", exact[i], word, held.squares[i]))
            }),
            low_pass: hold.hold(
                "ellipse.low_pass",
                kernel.low_pass,
                e.low_pass,
                held.low_pass,
            ),
            cutoff: hold.hold("raster.cutoff", cutoff, raster.cutoff, held.cutoff),
            root_cutoff: hold.hold(
                "ellipse.root_cutoff",
                cutoff.sqrt(),
                e.root_cutoff,
                held.root_cutoff,
            ),
            inverse_two_pi: hold.hold(
                "ellipse.inverse_two_pi",
                1.0 / TAU,
                e.inverse_two_pi,
                constant(e.inverse_two_pi, 1.0 / TAU),
            ),
        }
    }

    /// 1/s_x, 1/s_y.
    fn inverse_focals<H: Hold>(&self, hold: &H) -> [H::Real; 2] {
        let (word, held) = (
            self.machine.machine.ellipse.inverse_focal,
            self.quantised.frame.view.inverse_focals(),
        );
        [0, 1].map(|axis| {
            hold.hold_scaled(
                "ellipse.inverse_focal",
                1.0 / self.eye.focal_px[axis],
                word,
                held[axis],
            )
        })
    }

    /// Principal point from the picture's middle, pixels.
    fn centre<H: Hold>(&self, hold: &H) -> [H::Real; 2] {
        let (exact, word, held) = (
            self.eye.off_middle_px(),
            self.machine.machine.project.pixel,
            self.quantised.frame.view.centre,
        );
        [0, 1].map(|axis| hold.hold("project.pixel", exact[axis], word, held[axis]))
    }

    /// A splat's record; lengths in machine units.
    pub fn splat<H: Hold>(&self, hold: &H, index: usize) -> Splat<H::Real> {
        let (words, scale) = (&self.machine.machine.splat, &self.quantised.scale);
        let (exact, held): (_, &frame::Splat) = (
            &self.scene.splats[index],
            &self.quantised.frame.splats[index],
        );
        let of =
            |name, value: f64, word: Word, held: i32| hold.hold(name, value, word, i64::from(held));
        let position = (exact.position - DVec3::from_array(scale.offset)) * scale.factor();
        let position = vector(
            hold,
            "splat.position",
            position,
            words.position,
            held.position.map(i64::from),
        );
        Splat {
            position,
            normal: vector(
                hold,
                "splat.normal",
                exact.normal,
                words.normal,
                held.normal.map(i64::from),
            ),
            radius: of(
                "splat.radius",
                exact.radius * scale.factor(),
                words.radius,
                held.radius,
            ),
            rgb: self.colour(hold, index, position).unwrap_or_else(|| {
                [0, 1, 2].map(|channel| {
                    of(
                        "splat.rgb",
                        exact.rgb[channel],
                        words.rgb,
                        held.rgb[channel],
                    )
                })
            }),
            opacity: of("splat.opacity", exact.opacity, words.opacity, held.opacity),
            turned: None,
        }
    }

    /// Colour of a splat at a position from its harmonics; `None` where the machine's input has
    /// colours.
    fn colour<H: Hold>(
        &self,
        hold: &H,
        index: usize,
        position: [H::Real; 3],
    ) -> Option<[H::Real; 3]> {
        let (unit, word) = (
            self.machine.colour()?,
            self.machine.machine.colour?.coefficient,
        );
        let (exact, held) = (
            self.scene.ellipsoids.as_ref()?.harmonics.as_ref()?,
            self.quantised.frame.ellipsoids.as_ref()?,
        );
        let each = (usize::from(exact.degree) + 1).pow(2);
        let of = |index: usize| index * each..(index + 1) * each;
        let of_machine = self.quantised.harmonics.as_ref()?;
        let own = of_machine.of(&exact.coefficients[of(index)]);
        let coefficients = own.zip(&held.coefficients[of(index)]);
        let coefficients = coefficients.map(|(exact, held)| {
            [0, 1, 2].map(|channel| {
                hold.hold(
                    "colour.coefficient",
                    exact[channel],
                    word,
                    i64::from(held[channel]),
                )
            })
        });
        Some(unit.real(position, self.eye_word(hold), coefficients))
    }

    /// The eye, machine units.
    fn eye_word<H: Hold>(&self, hold: &H) -> [H::Real; 3] {
        let scale = &self.quantised.scale;
        let eye = (self.eye.eye - DVec3::from_array(scale.offset)) * scale.factor();
        let word = self.machine.machine.project.eye;
        vector(
            hold,
            "project.eye",
            eye,
            word,
            self.quantised.frame.view.eye,
        )
    }

    /// Ellipsoid of a splat; `None` where splats are discs.
    pub fn ellipsoid<H: Hold>(&self, hold: &H, index: usize) -> Option<Ellipsoid<H::Real>> {
        let (exact, frame) = (
            self.scene.ellipsoids.as_ref()?,
            self.quantised.frame.ellipsoids.as_ref()?,
        );
        let (m, kernel) = (&self.machine.machine, &frame.kernel);
        let words = m.ellipse.ellipsoid.as_ref()?;
        let limit = |axis: usize| {
            let exact = self.eye.slope(axis, self.scene.kernel.jacobian);
            hold.hold(
                "project.slope",
                exact,
                m.project.slope,
                kernel.jacobian[axis],
            )
        };
        let of = exact.orientation(index);
        let scales = |held: [i64; 3]| vector(hold, "ellipse.scale", of.scales, words.scale, held);
        let cutoff = self.box_cutoff(hold, kernel, index);
        let orientation = match frame.own.get(index) {
            Some(own) => {
                let DQuat { x, y, z, w } = of.rotation;
                let held = own.quaternion.map(i64::from);
                Orientation::Own {
                    quaternion: [(w, 0), (x, 1), (y, 2), (z, 3)].map(|(part, i)| {
                        hold.hold("ellipse.quaternion", part, words.quaternion, held[i])
                    }),
                    scales: scales(own.scales.map(i64::from)),
                }
            }
            None => {
                let turned = self.eye.rotation * DMat3::from_quat(of.rotation);
                let axes = [turned.x_axis, turned.y_axis, turned.z_axis];
                Orientation::Frame {
                    axes: [0, 1, 2].map(|axis| {
                        vector(
                            hold,
                            "ellipse.normal",
                            axes[axis],
                            m.ellipse.normal,
                            kernel.axes[axis],
                        )
                    }),
                    scales: scales(kernel.scales),
                }
            }
        };
        let inverse_distance =
            (self.quantised.inverse_distance)
                .zip(m.depth_weight())
                .map(|(exact, words)| {
                    hold.hold_scaled("sort.share", exact, words.share, kernel.inverse_distance)
                });
        Some(Ellipsoid {
            amplitude: kernel.amplitude,
            jacobian: [limit(0), limit(1)],
            cutoff,
            inverse_distance,
            orientation,
        })
    }

    /// Cutoff of a splat's box: that of the frame, or less for a low opacity.
    fn box_cutoff<H: Hold>(&self, hold: &H, kernel: &frame::Kernel, index: usize) -> H::Real {
        let machine = &self.machine.machine;
        let (exact, word) = (limited_cutoff(machine, self.scene), machine.raster.cutoff);
        let held = self.machine.box_cutoff(
            &self.quantised.frame.view,
            kernel,
            self.quantised.frame.splats[index].opacity,
        );
        let least = self
            .scene
            .least_opacity()
            .filter(|_| !kernel.reach.is_empty());
        let own = least.map_or(exact, |least| {
            exact
                .min(2.0 * libm::log(self.scene.splats[index].opacity / least))
                .max(0.0)
        });
        hold.hold("raster.cutoff", own, word, held)
    }

    /// Cutoff that r at a leader is compared with; `None` where blocks are not tested.
    pub fn leader_cutoff<H: Hold>(&self, hold: &H, index: usize) -> Option<H::Real> {
        let frame = &self.quantised.frame;
        let test = fixed::rules(&self.machine.machine).blocks?;
        let held = self.machine.contribution_cutoff(frame, index)?;
        let least = self.scene.least_opacity().filter(|_| test.by_opacity);
        let frame_cutoff = self.scene.kernel.cutoff;
        let own = least.map_or(frame_cutoff, |least| {
            let counts = 2.0 * libm::log(self.scene.splats[index].opacity / least);
            frame_cutoff.min(counts.max(0.0))
        });
        let word = self.machine.machine.raster.cutoff;
        Some(hold.hold("raster.cutoff", own, word, held))
    }

    /// Least opacity that is drawn; `None` where every opacity is.
    pub fn least_opacity<H: Hold>(&self, hold: &H) -> Option<H::Real> {
        let (exact, ellipsoids) = (
            self.scene.least_opacity()?,
            self.quantised.frame.ellipsoids.as_ref()?,
        );
        Some(hold.hold(
            "splat.opacity",
            exact,
            self.machine.machine.splat.opacity,
            ellipsoids.kernel.least_opacity,
        ))
    }

    /// The lighting registers, in camera space.
    pub fn lighting<H: Hold>(&self, hold: &H) -> Lighting<H::Real> {
        let (words, frame, scene) = (
            &self.machine.machine.shade,
            &self.quantised.frame,
            self.scene,
        );
        let light = |(exact, held): (&scene::Light, &frame::Light)| {
            let direction = self.eye.rotation * exact.direction;
            let toward = |exact: DVec3, held: [i64; 3]| {
                vector(hold, "shade.light", exact, words.light, held)
            };
            let half_way = held
                .half_way
                .map(|held| toward((direction - DVec3::Z).normalize(), held));
            Light {
                direction: toward(direction, held.direction),
                half_way,
            }
        };
        let reflectance =
            |exact: f64, held: i64| hold.hold("shade.reflectance", exact, words.reflectance, held);
        let material = |(exact, held): (&scene::Material, &frame::Material)| match (exact, held) {
            (
                scene::Material::BlinnPhong {
                    ambient,
                    diffuse,
                    specular,
                    shininess,
                },
                frame::Material::BlinnPhong {
                    ambient: held_ambient,
                    diffuse: held_diffuse,
                    specular: held_specular,
                    highlight,
                },
            ) => {
                let answers = |factor: f64, held: &[[i64; 3]]| {
                    let answer = |(light, held): (&scene::Light, &[i64; 3])| {
                        [0, 1, 2].map(|i| reflectance(factor * light.rgb[i], held[i]))
                    };
                    scene.lights.iter().zip(held).map(answer).collect()
                };
                Material::BlinnPhong {
                    ambient: reflectance(*ambient, *held_ambient),
                    diffuse: answers(*diffuse, held_diffuse),
                    specular: answers(*specular, held_specular),
                    highlight: self.machine.real_highlight(highlight, *shininess),
                }
            }
            _ => Material::Unlit,
        };
        let inverse = 1.0 / scene.surface.coverage_threshold;
        Lighting {
            lights: scene
                .lights
                .iter()
                .zip(&frame.lighting.lights)
                .map(light)
                .collect(),
            materials: scene
                .materials
                .iter()
                .zip(&frame.lighting.materials)
                .map(material)
                .collect(),
            coverage_threshold: self.coverage_threshold(hold),
            inverse_threshold: hold.hold_scaled(
                "shade.inverse_threshold",
                inverse,
                words.inverse_threshold,
                frame.inverse_threshold,
            ),
            surroundings: self.surroundings(hold),
        }
    }

    /// Surroundings; `None` where nothing reflects.
    fn surroundings<H: Hold>(&self, hold: &H) -> Option<Surroundings<H::Real>> {
        let (environment, held) = (
            self.scene.environment.as_ref()?,
            self.quantised.frame.surroundings.as_ref()?,
        );
        let (unit, machine) = (self.machine.shade.reflect()?, &self.machine.machine);
        let words = machine.reflect.as_ref()?;
        let reflectance = |exact: f64, held: i64| {
            hold.hold("reflect.reflectance", exact, words.reflectance, held)
        };
        let mirror = |(exact, held): (&scene::Mirror, &frame::Mirror)| Mirror {
            kept: reflectance(1.0 - exact.reflect, held.kept),
            mirrored: [0, 1, 2]
                .map(|i| reflectance(exact.reflect * exact.tint[i], held.mirrored[i])),
            is_dull: exact.reflect == 0.0,
        };
        Some(Surroundings {
            mirrors: environment
                .mirrors
                .iter()
                .zip(&held.mirrors)
                .map(mirror)
                .collect(),
            inverse_focals: self.inverse_focals(hold),
            centre: self.centre(hold),
            map: unit.real_map(self.quantised.texels.clone(), &held.texels),
        })
    }

    /// τ.
    pub fn coverage_threshold<H: Hold>(&self, hold: &H) -> H::Real {
        let word = self.machine.machine.fragment.weight_sum;
        hold.hold(
            "fragment.weight_sum",
            self.scene.surface.coverage_threshold,
            word,
            self.quantised.frame.coverage_threshold,
        )
    }

    /// ε, machine units.
    pub fn z_threshold<H: Hold>(&self, hold: &H) -> H::Real {
        let (exact, word) = (
            self.scene.surface.z_threshold * self.quantised.scale.factor(),
            self.machine.machine.fragment.depth,
        );
        hold.hold(
            "fragment.depth",
            exact,
            word,
            self.quantised.frame.z_threshold,
        )
    }

    /// Opacity from which a fragment hides everything behind it; `exact` is the value of the rules.
    pub fn opaque<H: Hold>(&self, hold: &H, exact: f64) -> H::Real {
        let word = self.machine.machine.fragment.opaque;
        let held =
            word.format.one() * i64::from(self.machine.machine.fragment.opaque_permille) / 1000;
        hold.hold("fragment.opaque", exact, word, held)
    }

    /// The background, premultiplied.
    pub fn background<H: Hold>(&self, hold: &H, shader: &Shader) -> [H::Real; 4] {
        let (exact, word) = (shader.background(), self.machine.machine.resolve.frame);
        [0, 1, 2, 3].map(|i| {
            hold.hold(
                "resolve.frame",
                exact[i],
                word,
                self.quantised.frame.background[i],
            )
        })
    }
}
