//! Models: machines and scenes.

use crate::work::{done, json, raised, refused};
use pyo3::buffer::{Element, PyBuffer};
use pyo3::prelude::*;
use splatsim::error::Error;
use splatsim::hardware::machines::{self, File};
use splatsim::scene::{self, Overrides, Sequence, Splat};
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

/// A machine, with its search record.
#[pyclass(frozen, module = "splatsim._native")]
#[derive(Clone)]
pub(crate) struct Machine {
    file: File,
    /// Whether a setting changed the picture.
    is_changed: bool,
}

#[pymethods]
impl Machine {
    /// A machine by name or from a file.
    #[staticmethod]
    fn open(name_or_path: OsString) -> PyResult<Self> {
        let file = machines::load_file(name_or_path, &[]).map_err(raised)?;
        Ok(Machine {
            file,
            is_changed: false,
        })
    }

    /// A machine from the text of a machine file; `whose` begins every error.
    #[staticmethod]
    fn parse(text: &str, whose: &str) -> PyResult<Self> {
        let value = serde_json::from_str(text.trim_start_matches('\u{feff}'))
            .map_err(|error| refused(format!("{whose}: {error}")))?;
        let file = machines::from_description(value, whose, whose).map_err(raised)?;
        Ok(Machine {
            file,
            is_changed: false,
        })
    }

    /// The machine with a change such as `gauss.weight=U-2F12`.
    fn changed(&self, setting: &str) -> PyResult<Self> {
        let machine = machines::changed(
            &self.file.machine,
            setting,
            &machines::flag("--set", setting),
        )
        .map_err(raised)?;
        let is_changed = self.is_changed || machines::changes_picture(setting);
        Ok(Machine {
            file: File {
                machine,
                ..self.file.clone()
            },
            is_changed,
        })
    }

    /// The machine as in a machine file.
    fn json(&self) -> PyResult<String> {
        json(&self.file)
    }

    /// Every word that can be set, and its format.
    fn words(&self) -> Vec<(String, String)> {
        machines::words(&self.file.machine)
            .into_iter()
            .map(|(path, format)| (path, format.to_string()))
            .collect()
    }
}

impl Machine {
    /// The requested machine, or the default one, for drawing a scene; and how the scene differs
    /// from those of its search.
    pub(crate) fn of(
        machine: Option<&Self>,
        scene: &scene::Scene,
    ) -> Result<(rtl_model::Machine, Option<Vec<String>>), Error> {
        let (file, is_changed) = match machine {
            Some(machine) => (machine.file.clone(), machine.is_changed),
            None => (machines::load_file(machines::usual(scene), &[])?, false),
        };
        let file = file.on(scene);
        let outside = file.outside(scene, is_changed);
        Ok((file.machine, outside))
    }
}

/// A scene, or a frame of one.
#[pyclass(frozen, module = "splatsim._native")]
#[derive(Clone)]
pub(crate) struct Scene {
    pub scene: Arc<scene::Scene>,
    /// Number of the frame in a sequence.
    pub frame: Option<u64>,
    /// File that it was read from.
    pub file: Option<PathBuf>,
    /// Text of an equivalent scene file, if there is one.
    pub text: Option<String>,
}

/// Splats as columns of numbers: three per splat for position, normal and colour.
type Columns = (
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<u32>,
);

#[pymethods]
impl Scene {
    /// A file, or a built-in name.
    #[staticmethod]
    fn open(
        py: Python<'_>,
        name_or_path: OsString,
        size: Option<(usize, usize)>,
        frame: Option<usize>,
    ) -> PyResult<Self> {
        done(py, None, move || {
            let mut sequence = Sequence::load(&name_or_path, &Overrides { size }, None)?;
            let number = frame.unwrap_or(0);
            sequence.frame(number)?;
            let text = if number == 0 {
                scene::Scene::text(&name_or_path)
            } else {
                None
            };
            Ok(Scene {
                frame: sequence.is_sequence().then_some(number as u64),
                scene: Arc::new(sequence.into_scene()),
                file: std::path::absolute(&name_or_path)
                    .ok()
                    .filter(|path| path.exists()),
                text,
            })
        })
    }

    /// The scene from the text of a scene file; files that it names are in `folder`.
    #[staticmethod]
    fn parse(
        py: Python<'_>,
        text: String,
        name: String,
        folder: PathBuf,
        size: Option<(usize, usize)>,
        frame: Option<usize>,
    ) -> PyResult<Self> {
        done(py, None, move || {
            let number = frame.unwrap_or(0);
            let scene =
                scene::Scene::from_text(&text, &name, &folder, &Overrides { size }, number)?;
            Ok(Scene {
                scene: Arc::new(scene),
                frame: frame.map(|frame| frame as u64),
                file: None,
                text: (number == 0).then_some(text),
            })
        })
    }

    /// The scene with splats from the caller's arrays.
    #[staticmethod]
    fn of_splats(
        py: Python<'_>,
        columns: Columns,
        text: String,
        name: String,
        folder: PathBuf,
        size: Option<(usize, usize)>,
        frame: Option<usize>,
    ) -> PyResult<Self> {
        let splats = splats(py, &columns)?;
        done(py, None, move || {
            let scene = scene::Scene::of_splats(
                splats,
                &text,
                &name,
                &folder,
                &Overrides { size },
                frame.unwrap_or(0),
            )?;
            Ok(Scene {
                scene: Arc::new(scene),
                frame: frame.map(|frame| frame as u64),
                file: None,
                text: None,
            })
        })
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.scene.name
    }

    /// Columns and rows of its picture.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.scene.image.width, self.scene.image.height)
    }

    /// Number of splats.
    #[getter]
    fn splats(&self) -> usize {
        self.scene.splats.len()
    }

    /// Sentences about omitted or unusual data.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.scene.notes.clone()
    }

    /// Name of the default machine for the scene.
    #[getter]
    fn usual_machine(&self) -> &'static str {
        machines::usual(&self.scene)
    }
}

fn splats(
    py: Python<'_>,
    (position, normal, radius, rgb, opacity, material): &Columns,
) -> PyResult<Vec<Splat>> {
    let count = radius.item_count();
    let [position, normal, rgb] = [
        column(py, position, 3 * count)?,
        column(py, normal, 3 * count)?,
        column(py, rgb, 3 * count)?,
    ];
    let [radius, opacity] = [column(py, radius, count)?, column(py, opacity, count)?];
    let material = column(py, material, count)?;
    let three = |cells: &[f64], at: usize| [cells[3 * at], cells[3 * at + 1], cells[3 * at + 2]];
    let splat = |at: usize| Splat {
        position: three(&position, at).into(),
        normal: three(&normal, at).into(),
        radius: radius[at],
        rgb: three(&rgb, at),
        opacity: opacity[at],
        material: material[at],
    };
    Ok((0..count).map(splat).collect())
}

fn column<T: Element>(py: Python<'_>, buffer: &PyBuffer<T>, count: usize) -> PyResult<Vec<T>> {
    if buffer.item_count() != count {
        return Err(refused(format!(
            "splats: an array has {} numbers instead of {count}",
            buffer.item_count()
        )));
    }
    buffer.to_vec(py)
}
