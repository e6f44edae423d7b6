//! Tree: builds a tree of splats for level of detail (docs/book/level-of-detail.md).

use super::arguments::Threads;
use crate::error::{Error, Result};
use crate::output::files::{are_one, write_beside};
use crate::output::text::{one_line, thousands, wrapped};
use crate::scene::tree::{MOST_CHILDREN, Tree, file};
use crate::scene::{Overrides, Scene};
use clap::Args;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(super) struct TreeArgs {
    /// Scene, point cloud or built-in name; discs only
    scene: OsString,
    /// Write the tree into this .tree file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Allow N children per node
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u64).range(2..=MOST_CHILDREN as u64))]
    children: u64,
    /// Do not print progress or results
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    pub threads: Threads,
}

/// Checked arguments.
pub(super) struct TreeJob {
    scene: Scene,
    out: PathBuf,
    children: usize,
    quiet: bool,
}

impl TreeArgs {
    pub fn check(self) -> Result<TreeJob> {
        check_out(&self.out)?;
        if are_one(Path::new(&self.scene), &self.out) {
            return Err(Error::input(format!(
                "--out {}: it is the scene itself",
                self.out.display()
            )));
        }
        let scene = Scene::load(&self.scene, &Overrides::default())?;
        let scene = scene.full().unwrap_or(scene);
        if scene.ellipsoids.is_some() {
            let name = one_line(&self.scene.to_string_lossy());
            return Err(Error::input(format!(
                "{name}: a tree is of discs, and these splats are voxels, Gaussians or an isosurface"
            )));
        }
        Ok(TreeJob {
            scene,
            out: self.out,
            children: self.children as usize,
            quiet: self.quiet,
        })
    }
}

/// Fails early if the tree cannot be written to `path`.
fn check_out(path: &Path) -> Result<()> {
    let cannot = |why: &str| Err(Error::input(format!("--out {}: {why}", path.display())));
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    if !path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("tree"))
    {
        return cannot("trees are written as .tree");
    }
    if path.is_dir() {
        return cannot("it is a folder, and a file is needed");
    }
    if !folder.is_dir() {
        return cannot("there is no such folder");
    }
    Ok(())
}

impl TreeJob {
    pub fn run(self) -> Result<String> {
        let TreeJob {
            scene,
            out,
            children,
            quiet,
        } = self;
        let tree = Tree::new(&scene.splats, children)
            .ok_or_else(|| Error::input(format!("{}: holds no splats", scene.name)))?;
        let bytes = file::bytes(&tree);
        write_beside(&out, |file| {
            file.write_all(&bytes).map_err(|e| e.to_string())
        })?;
        if quiet {
            return Ok(String::new());
        }
        let inner = tree.nodes().len() - tree.leaves();
        let of = format!(
            "{}: {} splats, {} nodes above them, {} levels, at most {} children a node",
            scene.name,
            thousands(tree.leaves() as u64),
            thousands(inner as u64),
            tree.levels(),
            tree.most_children()
        );
        let radius = |level: u32| {
            let of_level = tree.nodes().iter().filter(|node| node.level == level);
            let (count, sum) = of_level.fold((0u64, 0.0), |(count, sum), node| {
                (count + 1, sum + node.splat.radius)
            });
            format!(
                "level {level}: {} of mean radius {:.3e}",
                thousands(count),
                sum / count as f64
            )
        };
        let levels = (0..tree.levels() as u32).map(radius);
        let end = format!(
            "written to {}: {} bytes",
            one_line(&out.to_string_lossy()),
            thousands(bytes.len() as u64)
        );
        Ok(std::iter::once(of)
            .chain(levels)
            .chain([end])
            .map(|line| wrapped(&line))
            .collect::<Vec<_>>()
            .join("\n"))
    }
}
