//! Handles: machines, scenes, and what comes of drawing one on the other.

use crate::text::{Told, guarded, hand_out, sound, string};
use splatsim::error::Error;
use splatsim::hardware::{fixed, machines};
use splatsim::output::picture::Picture;
use splatsim::run::{self, Options, RunResult};
use splatsim::scene::{Overrides, Scene as Loaded};
use std::ffi::{c_char, c_int};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A machine.
pub struct Machine(Mutex<rtl_model::Machine>);

/// A scene.
pub struct Scene(pub(crate) Loaded);

/// Three pictures of a scene, and the report.
pub struct Drawing {
    outcome: RunResult,
    report: String,
}

pub(crate) const fn is_shared<T: Send + Sync>() {}
const _: () = {
    is_shared::<Machine>();
    is_shared::<Scene>();
    is_shared::<Drawing>();
};

/// What the hardware draws.
pub const SPLATSIM_FIXED: c_int = 0;
/// The same rules in exact arithmetic.
pub const SPLATSIM_GOLDEN: c_int = 1;
/// Exact arithmetic without a limit of fragments.
pub const SPLATSIM_IDEAL: c_int = 2;

/// What a handle points to.
///
/// # Safety
/// NULL, or a handle that was made here and not freed.
pub(crate) unsafe fn held<'a, T>(handle: *const T, what: &str) -> Told<&'a T> {
    // SAFETY: the caller's.
    unsafe { handle.as_ref() }.ok_or_else(|| format!("{what} is NULL"))
}

pub(crate) fn handle<T>(made: T) -> *mut T {
    Box::into_raw(Box::new(made))
}

/// Frees a handle.
///
/// # Safety
/// As [`held`]; nobody uses it any more.
pub(crate) unsafe fn freed<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: the caller's: it came from `handle`.
        guarded((), || {
            drop(unsafe { Box::from_raw(handle) });
            Ok(())
        });
    }
}

/// What is behind a lock, even where another call failed while it had it: no call leaves anything
/// half done that another could trip over.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn sentence(error: Error) -> String {
    error.to_string()
}

impl Machine {
    pub(crate) fn now(&self) -> rtl_model::Machine {
        locked(&self.0).clone()
    }
}

/// A named machine, such as "reference", or that of a file. NULL where there is none.
///
/// # Safety
/// `name_or_path` is NULL or a string that ends in 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_open(name_or_path: *const c_char) -> *mut Machine {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let name = unsafe { string(name_or_path, "name_or_path") }?;
        checked(machines::load(name, &[]).map_err(sentence)?)
    })
}

/// The machine that a JSON text of `length` bytes describes, as a machine file does. NULL where it
/// describes none.
///
/// # Safety
/// `json` is NULL or points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_from_json(
    json: *const c_char,
    length: usize,
) -> *mut Machine {
    guarded(std::ptr::null_mut(), || {
        sound(json, length, "json")?;
        // SAFETY: the caller's; it was checked.
        let bytes = unsafe { std::slice::from_raw_parts(json.cast::<u8>(), length) };
        let value = serde_json::from_slice(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
            .map_err(|e| format!("the machine is no JSON: {e}"))?;
        checked(machines::from_value(&value, "the machine").map_err(sentence)?)
    })
}

fn checked(machine: rtl_model::Machine) -> Told<*mut Machine> {
    fixed::elaborate(&machine).map_err(sentence)?;
    Ok(handle(Machine(Mutex::new(machine))))
}

/// Changes a field, as in "gauss.weight=U-2F12". 0, or -1 where the machine has no such field or
/// cannot be built with it: it then stays as it was. Units and drawings that were made before keep
/// the machine that they were made with.
///
/// # Safety
/// `machine` is NULL or a machine, `setting` NULL or a string that ends in 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_set(
    machine: *mut Machine,
    setting: *const c_char,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let (machine, setting) =
            unsafe { (held(machine, "machine")?, string(setting, "setting")?) };
        let mut machine = locked(&machine.0);
        let changed = machines::changed(&machine, setting, setting).map_err(sentence)?;
        fixed::elaborate(&changed).map_err(sentence)?;
        *machine = changed;
        Ok(0)
    })
}

/// Writes the machine as JSON, and a 0, into `text` if `capacity` is greater than the count that is
/// returned: bytes without the 0. -1 on failure.
///
/// # Safety
/// `machine` is NULL or a machine; `text` is NULL, with capacity 0, or has room for `capacity`
/// bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_json(
    machine: *const Machine,
    text: *mut c_char,
    capacity: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: the caller's.
        let machine = unsafe { held(machine, "machine") }?.now();
        let json = serde_json::to_string_pretty(&machine).map_err(|e| e.to_string())?;
        // SAFETY: the caller's.
        unsafe { hand_out(&json, text, capacity) }
    })
}

/// Frees a machine; NULL is nothing.
///
/// # Safety
/// `machine` is NULL or a machine, and used by nobody any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_free(machine: *mut Machine) {
    // SAFETY: the caller's.
    unsafe { freed(machine) }
}

/// A scene's file, a cloud, a volume or a built-in name, such as "glass-spheres"; in a picture of
/// so many columns and rows, or, where one is 0, of its own size. NULL where it cannot be read.
///
/// # Safety
/// `name_or_path` is NULL or a string that ends in 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_scene_open(
    name_or_path: *const c_char,
    width: u32,
    height: u32,
) -> *mut Scene {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let name = unsafe { string(name_or_path, "name_or_path") }?;
        let size = (width != 0 && height != 0).then_some((width as usize, height as usize));
        Ok(handle(Scene(
            Loaded::load(name, &Overrides { size }).map_err(sentence)?,
        )))
    })
}

/// Frees a scene; NULL is nothing.
///
/// # Safety
/// `scene` is NULL or a scene, and used by nobody any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_scene_free(scene: *mut Scene) {
    // SAFETY: the caller's.
    unsafe { freed(scene) }
}

/// Draws a scene on a machine and in exact arithmetic. NULL where the machine cannot hold it.
///
/// # Safety
/// Both are NULL or what their types say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_draw(
    machine: *const Machine,
    scene: *const Scene,
) -> *mut Drawing {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let (machine, scene) = unsafe { (held(machine, "machine")?.now(), held(scene, "scene")?) };
        let outcome = run::run(&scene.0, &machine, 0.0, &Options::default()).map_err(sentence)?;
        let report = serde_json::to_string_pretty(&outcome.report).map_err(|e| e.to_string())?;
        Ok(handle(Drawing { outcome, report }))
    })
}

/// Columns and rows of the pictures. 0, or -1 on failure.
///
/// # Safety
/// `drawing` is NULL or a drawing, `width` and `height` NULL or places for a number each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_drawing_size(
    drawing: *const Drawing,
    width: *mut u32,
    height: *mut u32,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let picture = unsafe { &held(drawing, "drawing")?.outcome.fixed };
        sound(width, 1, "width")?;
        sound(height, 1, "height")?;
        // SAFETY: the caller's; both were checked.
        unsafe { (*width, *height) = (picture.width as u32, picture.height as u32) };
        Ok(0)
    })
}

/// Writes one of the pictures, SPLATSIM_FIXED and so on, into `rgba`: linear light, premultiplied,
/// four numbers a pixel, row by row from the top. `count` must be 4 * width * height. 0, or -1 on
/// failure.
///
/// # Safety
/// `drawing` is NULL or a drawing, `rgba` NULL or a place for `count` numbers, which nobody else
/// uses meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_picture(
    drawing: *const Drawing,
    which: c_int,
    rgba: *mut f64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let outcome = unsafe { &held(drawing, "drawing")?.outcome };
        let Picture { rgba: pixels, .. } = match which {
            SPLATSIM_FIXED => &outcome.fixed,
            SPLATSIM_GOLDEN => &outcome.golden,
            SPLATSIM_IDEAL => &outcome.ideal,
            _ => {
                return Err(format!(
                    "there is no picture {which}: 0 is fixed, 1 golden, 2 ideal"
                ));
            }
        };
        let pixels = pixels.as_flattened();
        sound(rgba, count, "rgba")?;
        if count != pixels.len() {
            return Err(format!(
                "rgba needs room for {} numbers, and count says {count}",
                pixels.len()
            ));
        }
        // SAFETY: the caller's; it was checked, and `count` compared.
        unsafe { std::ptr::copy_nonoverlapping(pixels.as_ptr(), rgba, count) };
        Ok(0)
    })
}

/// Writes the report as JSON, as `report.json` has it, and a 0, into `text` if `capacity` is
/// greater than the count that is returned: bytes without the 0. -1 on failure.
///
/// # Safety
/// `drawing` is NULL or a drawing; `text` is NULL, with capacity 0, or has room for `capacity`
/// bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_report_json(
    drawing: *const Drawing,
    text: *mut c_char,
    capacity: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: the caller's.
        unsafe { hand_out(&held(drawing, "drawing")?.report, text, capacity) }
    })
}

/// Frees a drawing; NULL is nothing.
///
/// # Safety
/// `drawing` is NULL or a drawing, and used by nobody any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_drawing_free(drawing: *mut Drawing) {
    // SAFETY: the caller's.
    unsafe { freed(drawing) }
}
