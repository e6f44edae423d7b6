//! Handles: machines, scenes, and drawings.

use crate::text::{CallResult, guarded, hand_out, sound, string};
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

/// Picture of the hardware.
pub const SPLATSIM_FIXED: c_int = 0;
/// Picture by the same rules in exact arithmetic.
pub const SPLATSIM_GOLDEN: c_int = 1;
/// Picture in exact arithmetic without a limit of fragments.
pub const SPLATSIM_IDEAL: c_int = 2;

/// Dereferences a handle.
///
/// # Safety
/// NULL, or a handle of this library that was not freed.
pub(crate) unsafe fn held<'a, T>(handle: *const T, what: &str) -> CallResult<&'a T> {
    // SAFETY: guaranteed by the caller.
    unsafe { handle.as_ref() }.ok_or_else(|| format!("{what} is NULL"))
}

pub(crate) fn handle<T>(made: T) -> *mut T {
    Box::into_raw(Box::new(made))
}

/// Frees a handle.
///
/// # Safety
/// As [`held`], and the handle is not used any more.
pub(crate) unsafe fn freed<T>(handle: *mut T) {
    if !handle.is_null() {
        // SAFETY: guaranteed by the caller: it came from `handle`.
        guarded((), || {
            drop(unsafe { Box::from_raw(handle) });
            Ok(())
        });
    }
}

/// Locks a mutex, even after a call failed while holding it: a failed call leaves consistent data.
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

/// Opens a named machine, such as "reference", or a machine file. NULL on failure.
///
/// # Safety
/// `name_or_path` is NULL or a string that ends in 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_open(name_or_path: *const c_char) -> *mut Machine {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: guaranteed by the caller.
        let name = unsafe { string(name_or_path, "name_or_path") }?;
        checked(machines::load(name, &[]).map_err(sentence)?)
    })
}

/// Makes the machine of a JSON text of `length` bytes, as in a machine file. NULL if it is not a
/// machine.
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
        // SAFETY: guaranteed by the caller; it was checked.
        let bytes = unsafe { std::slice::from_raw_parts(json.cast::<u8>(), length) };
        let value = serde_json::from_slice(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
            .map_err(|e| format!("the machine is not JSON: {e}"))?;
        checked(machines::from_value(&value, "the machine").map_err(sentence)?)
    })
}

fn checked(machine: rtl_model::Machine) -> CallResult<*mut Machine> {
    fixed::elaborate(&machine).map_err(sentence)?;
    Ok(handle(Machine(Mutex::new(machine))))
}

/// Changes a field, as in "gauss.weight=U-2F12". 0, or -1 for an unknown field or an invalid value:
/// the machine is unchanged then. Existing units and drawings keep the machine that they were made
/// with.
///
/// # Safety
/// `machine` is NULL or a machine, `setting` NULL or a string that ends in 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_set(
    machine: *mut Machine,
    setting: *const c_char,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (machine, setting) =
            unsafe { (held(machine, "machine")?, string(setting, "setting")?) };
        let mut machine = locked(&machine.0);
        let changed = machines::changed(&machine, setting, setting).map_err(sentence)?;
        fixed::elaborate(&changed).map_err(sentence)?;
        *machine = changed;
        Ok(0)
    })
}

/// Writes the machine as JSON, with a terminating 0, into `text` if `capacity` is greater than the
/// returned count: bytes without the 0. -1 on failure.
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
        // SAFETY: guaranteed by the caller.
        let machine = unsafe { held(machine, "machine") }?.now();
        let json = serde_json::to_string_pretty(&machine).map_err(|e| e.to_string())?;
        // SAFETY: guaranteed by the caller.
        unsafe { hand_out(&json, text, capacity) }
    })
}

/// Frees a machine; does nothing for NULL.
///
/// # Safety
/// `machine` is NULL or a machine that is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_machine_free(machine: *mut Machine) {
    // SAFETY: guaranteed by the caller.
    unsafe { freed(machine) }
}

/// Opens a scene file, a cloud, a volume or a built-in scene, such as "glass-spheres". `width` and
/// `height` are the size of the picture; if one is 0, the scene's own size is used. NULL if it
/// cannot be read.
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
        // SAFETY: guaranteed by the caller.
        let name = unsafe { string(name_or_path, "name_or_path") }?;
        let size = (width != 0 && height != 0).then_some((width as usize, height as usize));
        Ok(handle(Scene(
            Loaded::load(name, &Overrides { size }).map_err(sentence)?,
        )))
    })
}

/// Frees a scene; does nothing for NULL.
///
/// # Safety
/// `scene` is NULL or a scene that is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_scene_free(scene: *mut Scene) {
    // SAFETY: guaranteed by the caller.
    unsafe { freed(scene) }
}

/// Draws a scene on a machine and in exact arithmetic. NULL if a register of the machine cannot
/// hold a value of the scene.
///
/// # Safety
/// Both are NULL or of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_draw(
    machine: *const Machine,
    scene: *const Scene,
) -> *mut Drawing {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: guaranteed by the caller.
        let (machine, scene) = unsafe { (held(machine, "machine")?.now(), held(scene, "scene")?) };
        let outcome = run::run(&scene.0, &machine, 0.0, &Options::default()).map_err(sentence)?;
        let report = serde_json::to_string_pretty(&outcome.report).map_err(|e| e.to_string())?;
        Ok(handle(Drawing { outcome, report }))
    })
}

/// Columns and rows of the pictures. 0, or -1 on failure.
///
/// # Safety
/// `drawing` is NULL or a drawing, `width` and `height` NULL or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_drawing_size(
    drawing: *const Drawing,
    width: *mut u32,
    height: *mut u32,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let picture = unsafe { &held(drawing, "drawing")?.outcome.fixed };
        sound(width, 1, "width")?;
        sound(height, 1, "height")?;
        // SAFETY: guaranteed by the caller; both were checked.
        unsafe { (*width, *height) = (picture.width as u32, picture.height as u32) };
        Ok(0)
    })
}

/// Writes one of the pictures, such as SPLATSIM_FIXED, into `rgba`: linear light, premultiplied,
/// four numbers per pixel, row by row from the top. `count` must be 4 * width * height. 0, or -1 on
/// failure.
///
/// # Safety
/// `drawing` is NULL or a drawing, `rgba` NULL or writable for `count` numbers, without other users
/// during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_picture(
    drawing: *const Drawing,
    which: c_int,
    rgba: *mut f64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
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
                "rgba needs room for {} numbers, but count is {count}",
                pixels.len()
            ));
        }
        // SAFETY: guaranteed by the caller; it was checked, and `count` compared.
        unsafe { std::ptr::copy_nonoverlapping(pixels.as_ptr(), rgba, count) };
        Ok(0)
    })
}

/// Writes the report as JSON, as in `report.json`, with a terminating 0, into `text` if `capacity`
/// is greater than the returned count: bytes without the 0. -1 on failure.
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
        // SAFETY: guaranteed by the caller.
        unsafe { hand_out(&held(drawing, "drawing")?.report, text, capacity) }
    })
}

/// Frees a drawing; does nothing for NULL.
///
/// # Safety
/// `drawing` is NULL or a drawing that is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_drawing_free(drawing: *mut Drawing) {
    // SAFETY: guaranteed by the caller.
    unsafe { freed(drawing) }
}
