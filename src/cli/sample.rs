//! Sample: samples points on a mesh.

use super::arguments::Threads;
use crate::error::{Error, Result};
use crate::input;
use crate::output::files::are_one;
use crate::output::text::{one_line, thousands, wrapped};
use crate::sampling::{
    Acquisition, Amount, Pattern, Picture, Radii, Sampled, SamplingRequest, Solution, file, sample,
};
use crate::scene::mesh::{Image, Mesh, Texture, Wrap};
use clap::{Args, ValueEnum};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[derive(Args, Debug)]
pub(super) struct SampleArgs {
    /// Mesh: .obj, .ply, .gltf, .glb, .stl, or plane
    mesh: OsString,
    /// Make N points
    #[arg(
        long,
        value_name = "N",
        required_unless_present = "density",
        conflicts_with = "density"
    )]
    points: Option<u32>,
    /// Make D points per unit of area
    #[arg(long, value_name = "D")]
    density: Option<f64>,
    /// Write the points into this PLY file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Use `blue-noise` (default) or `stratified` points
    #[arg(
        long,
        default_value = "blue-noise",
        hide_default_value = true,
        hide_possible_values = true
    )]
    pattern: PatternFlag,
    /// Set the seed of the distribution
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Take radii from `area` (default) or `neighbours`
    #[arg(
        long,
        default_value = "area",
        hide_default_value = true,
        hide_possible_values = true
    )]
    radii: RadiiFlag,
    /// Filter: `ewa` (default), `nearest`, `optimised`
    #[arg(
        long,
        default_value = "ewa",
        hide_default_value = true,
        hide_possible_values = true
    )]
    texture: TextureFlag,
    /// Apply this PNG or JPEG as texture
    #[arg(long, value_name = "FILE", conflicts_with = "checkerboard")]
    texture_image: Option<PathBuf>,
    /// Apply a checkerboard of N×N squares
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=2048))]
    checkerboard: Option<u16>,
    /// Assume this `kernel.cutoff` of scenes
    #[arg(long, value_name = "R", default_value_t = 2.0)]
    cutoff: f64,
    /// Do not print progress or results
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum PatternFlag {
    BlueNoise,
    Stratified,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum RadiiFlag {
    Neighbours,
    Area,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum TextureFlag {
    Nearest,
    Ewa,
    Optimised,
}

/// Checked arguments.
pub(super) struct SampleJob {
    name: String,
    mesh: Mesh,
    request: SamplingRequest,
    out: PathBuf,
    quiet: bool,
}

impl SampleArgs {
    pub fn check(self) -> Result<SampleJob> {
        let amount = match (self.points, self.density) {
            (Some(points), _) => Amount::Points(points as usize),
            (None, Some(density)) if density > 0.0 && density.is_finite() => {
                Amount::Density(density)
            }
            (None, density) => {
                return Err(Error::input(format!(
                    "--density {}: it must be above 0",
                    density.unwrap_or(f64::NAN)
                )));
            }
        };
        if !(0.01..=100.0).contains(&self.cutoff) {
            return Err(Error::input(format!(
                "--cutoff {}: it must be from 0.01 to 100",
                self.cutoff
            )));
        }
        check_out(&self.out)?;
        if are_one(Path::new(&self.mesh), &self.out) {
            return Err(Error::input(format!(
                "--out {}: it is the mesh itself",
                self.out.display()
            )));
        }
        let picture = match (&self.texture_image, self.checkerboard) {
            (Some(path), _) => picture(path)?,
            (None, Some(checks)) => Picture::checkerboard(checks.into()),
            (None, None) => Picture::Own,
        };
        let request = SamplingRequest {
            amount,
            pattern: match self.pattern {
                PatternFlag::BlueNoise => Pattern::BlueNoise,
                PatternFlag::Stratified => Pattern::Stratified,
            },
            seed: self.seed,
            radii: match self.radii {
                RadiiFlag::Neighbours => Radii::Neighbours,
                RadiiFlag::Area => Radii::Area,
            },
            acquisition: match self.texture {
                TextureFlag::Nearest => Acquisition::Nearest,
                TextureFlag::Ewa => Acquisition::Ewa,
                TextureFlag::Optimised => Acquisition::Optimised,
            },
            picture,
            cutoff: self.cutoff,
        };
        let name = self.mesh.to_string_lossy().into_owned();
        Ok(SampleJob {
            mesh: Mesh::load(&self.mesh)?,
            name,
            request,
            out: self.out,
            quiet: self.quiet,
        })
    }
}

/// Fails early if the points cannot be written to `path`.
fn check_out(path: &Path) -> Result<()> {
    let cannot = |why: &str| Err(Error::input(format!("--out {}: {why}", path.display())));
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("ply") => {}
        _ => return cannot("points are written as .ply"),
    }
    if path.is_dir() {
        return cannot("it is a folder, and a file is needed");
    }
    if !folder.is_dir() {
        return cannot("there is no such folder");
    }
    Ok(())
}

fn picture(path: &Path) -> Result<Picture> {
    let wrong = |why: String| Error::input(format!("{}: {why}", path.display()));
    let bytes = input::read(path).map_err(|e| wrong(format!("cannot be read: {e}")))?;
    let image = Image::decode(&bytes).map_err(wrong)?;
    Ok(Picture::Texture(Texture {
        image: Arc::new(image),
        wrap: [Wrap::Repeat; 2],
    }))
}

impl SampleJob {
    pub fn run(self) -> Result<String> {
        let SampleJob {
            name,
            mesh,
            request,
            out,
            quiet,
        } = self;
        let sampled = sample(&mesh, &request)
            .map_err(|sentence| Error::input(format!("{name}: {sentence}")))?;
        let bytes = file::write(&out, &sampled.splats)?;
        let end = format!(
            "written to {}: {} bytes",
            one_line(&out.to_string_lossy()),
            thousands(bytes as u64)
        );
        let lines = summary(&mesh, &request, &sampled)
            .into_iter()
            .chain([end])
            .map(|line| wrapped(&line))
            .collect::<Vec<_>>();
        Ok(if quiet {
            String::new()
        } else {
            lines.join("\n")
        })
    }
}

fn summary(mesh: &Mesh, request: &SamplingRequest, sampled: &Sampled) -> Vec<String> {
    let left_out = match mesh.degenerate {
        0 => String::new(),
        count => format!(" ({} without an area left out)", thousands(count as u64)),
    };
    let mut lines = vec![format!(
        "{} triangles{left_out}, area {:.6}",
        thousands(mesh.triangles.len() as u64),
        sampled.area
    )];
    let apart = sampled.spacing.map_or(String::new(), |spacing| {
        format!(", at least {spacing:.3e} apart")
    });
    let radius = |pick: fn(f64, f64) -> f64| {
        sampled
            .splats
            .iter()
            .map(|splat| splat.radius)
            .reduce(pick)
            .unwrap_or(0.0)
    };
    lines.push(format!(
        "{} points{apart}, of radii {:.3e} to {:.3e}",
        thousands(sampled.splats.len() as u64),
        radius(f64::min),
        radius(f64::max)
    ));
    if let Some(solution) = sampled.solution {
        let Solution {
            residual,
            damped_residual,
            steps,
            ..
        } = solution;
        lines.push(format!("colours solved for: residual {residual:.1e}, of the damped system {damped_residual:.1e} after {steps} steps"));
    }
    if request.acquisition == Acquisition::Optimised {
        let (beyond, all) = (
            thousands(sampled.beyond as u64),
            thousands(sampled.splats.len() as u64),
        );
        let most = if sampled.beyond == 0 {
            String::new()
        } else {
            format!(", by at most {:.3}; scenes clamp them", sampled.most_beyond)
        };
        lines.push(format!("{beyond} of {all} colours leave [0, 1]{most}"));
    }
    lines.extend(
        mesh.notes
            .iter()
            .chain(&sampled.notes)
            .map(|note| format!("note: {note}")),
    );
    lines
}
