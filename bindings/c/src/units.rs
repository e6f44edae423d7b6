//! Units: one unit of a machine, words in and words out, and comparison of its output with a
//! device's records.

use crate::handles::{Machine, Scene, freed, handle, held, is_shared, locked, sentence};
use crate::text::{CallResult, guarded, hand_out, sound, string};
use self_cell::self_cell;
use splatsim::cosim::live::{Constants, Port, Record};
use splatsim::cosim::scoreboard::{PortSide, Scoreboard};
use std::ffi::{c_char, c_int};
use std::sync::Mutex;

/// A unit by itself, and its output records that have not been read.
pub struct Unit(Mutex<Cell>);

self_cell!(
    struct Cell {
        owner: Constants,
        #[covariant]
        dependent: Scoreboard,
    }
);

const _: () = is_shared::<Unit>();

/// Port: input records of a unit.
pub const SPLATSIM_IN: c_int = 0;
/// Port: output records of a unit.
pub const SPLATSIM_OUT: c_int = 1;
/// Port: requests of fragment to shade.
pub const SPLATSIM_REQUEST: c_int = 2;
/// Port: responses of shade to fragment.
pub const SPLATSIM_ANSWER: c_int = 3;
/// Port: final contents of fragment's pixels.
pub const SPLATSIM_HELD: c_int = 4;

fn side(port: c_int) -> CallResult<PortSide> {
    let side = usize::try_from(port)
        .ok()
        .and_then(|port| PortSide::ALL.get(port).copied());
    side.ok_or_else(|| {
        format!("there is no port {port}: 0 is in, 1 out, 2 request, 3 answer, 4 held")
    })
}

impl Unit {
    pub(crate) fn with<T>(
        &self,
        work: impl FnOnce(&mut Scoreboard) -> CallResult<T>,
    ) -> CallResult<T> {
        locked(&self.0).with_dependent_mut(|_, board| work(board))
    }

    /// A constant of a frame: its port and its records.
    fn registers(&self, name: &str) -> CallResult<(Port, Vec<Record>)> {
        let found = locked(&self.0).with_dependent(|constants, _| constants.registers(name));
        found.ok_or_else(|| {
            format!("{name} is not constant in a frame: frame, light, material and reflection are")
        })
    }
}

/// A port of a unit, if it has it.
fn port_of<'a>(board: &'a Scoreboard, port: c_int) -> CallResult<&'a Port> {
    board
        .port(side(port)?)
        .ok_or_else(|| format!("{} has no port {port}", board.name()))
}

/// `count` numbers.
///
/// # Safety
/// `words` is NULL or points to `count` initialised numbers that do not change during the call.
unsafe fn given<'a, T>(words: *const T, count: usize) -> CallResult<&'a [T]> {
    sound(words, count, "words")?;
    // SAFETY: guaranteed by the caller; NULL, the address and the size were checked.
    Ok(unsafe { std::slice::from_raw_parts(words, count) })
}

/// Writes numbers to `words`, as many as fit, and 0 after them. The memory may be uninitialised, so
/// no slice is made of it.
///
/// # Safety
/// [`sound`] holds, and there is room for `count` numbers, without other users.
unsafe fn hand_over<T: Copy + Default>(from: &[T], words: *mut T, count: usize) {
    for place in 0..count {
        // SAFETY: guaranteed by the caller.
        unsafe {
            words
                .add(place)
                .write(from.get(place).copied().unwrap_or_default())
        };
    }
}

/// A record as 32-bit words.
fn packed(port: &Port, record: &[i64]) -> Vec<u32> {
    let mut halves = vec![0; halves(port)];
    port.pack(record, &mut halves);
    halves
}

/// Number of 32-bit words of a record.
fn halves(port: &Port) -> usize {
    port.width().div_ceil(32) as usize
}

/// Makes the unit of a machine with a name, such as "raster", with registers, lights and materials
/// of a scene. Random records depend on `seed`. NULL for an unknown unit. Machine and scene may be
/// freed before the unit.
///
/// # Safety
/// All are NULL or of their types.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_new(
    machine: *const Machine,
    scene: *const Scene,
    name: *const c_char,
    seed: u64,
) -> *mut Unit {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: guaranteed by the caller.
        let (machine, scene, name) = unsafe {
            (
                held(machine, "machine")?.now(),
                held(scene, "scene")?,
                string(name, "name")?,
            )
        };
        let constants = Constants::new(&scene.0, &machine).map_err(sentence)?;
        let cell = Cell::try_new(constants, |constants| {
            Scoreboard::new(constants, name, seed)
        })
        .map_err(sentence)?;
        Ok(handle(Unit(Mutex::new(cell))))
    })
}

/// Frees a unit; does nothing for NULL.
///
/// # Safety
/// `unit` is NULL or a unit that is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_free(unit: *mut Unit) {
    // SAFETY: guaranteed by the caller.
    unsafe { freed(unit) }
}

/// Words in a record of a port, such as SPLATSIM_IN: one per field. -1 if the unit does not have
/// the port.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_fields(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: guaranteed by the caller.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(port_of(board, port)?.fields() as isize))
    })
}

/// Bits in a record of a port. -1 if the unit does not have the port.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_width(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: guaranteed by the caller.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(port_of(board, port)?.width() as isize))
    })
}

/// Writes a field's name, with a terminating 0, into `text` if `capacity` is greater than the
/// returned count: bytes without the 0. -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit; `text` is NULL, with capacity 0, or has room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_field(
    unit: *const Unit,
    port: c_int,
    field: usize,
    text: *mut c_char,
    capacity: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let name = unsafe { held(unit, "unit") }?.with(|board| {
            let field = port_of(board, port)?.stream.fields.get(field);
            field
                .map(|field| field.name.clone())
                .ok_or_else(|| "unknown field".into())
        })?;
        // SAFETY: guaranteed by the caller.
        unsafe { hand_out(&name, text, capacity) }
    })
}

/// Passes a record to the unit, one word per field. The output is queued at every port until it is
/// read (`splatsim_unit_next`) or compared. This includes fragment's requests and responses, whose
/// queues grow if they are not read. Returns the number of queued records at SPLATSIM_OUT, or -1
/// for an invalid record: the unit is unchanged then.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a pointer to `count` initialised words that do not
/// change during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_step(
    unit: *mut Unit,
    words: *const i64,
    count: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        unit.with(|board| step(board, words))
    })
}

/// `splatsim_unit_step` for a record in 32-bit words, as in a line of a trace, the least
/// significant first.
///
/// # Safety
/// As `splatsim_unit_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_step_bits(
    unit: *mut Unit,
    words: *const u32,
    count: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        unit.with(|board| {
            let record = port_of(board, SPLATSIM_IN)?
                .unpack(words)
                .map_err(|refused| refused.to_string())?;
            step(board, &record)
        })
    })
}

fn step(board: &mut Scoreboard, words: &[i64]) -> CallResult<isize> {
    board.step(words).map_err(|refused| refused.to_string())?;
    Ok(board.waiting(PortSide::Out) as isize)
}

/// Ends a frame: fragment outputs its pixels' contents, sort the sorted records, and both are
/// empty. Returns the number of queued records at SPLATSIM_OUT and SPLATSIM_HELD, or -1 if the last
/// layer of a pixel is missing.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_end(unit: *mut Unit) -> isize {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        unsafe { held(unit, "unit") }?.with(|board| {
            board.end().map_err(|refused| refused.to_string())?;
            Ok((board.waiting(PortSide::Out) + board.waiting(PortSide::Held)) as isize)
        })
    })
}

/// Number of queued records at a port. -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_waiting(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: guaranteed by the caller.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(board.waiting(side(port)?) as isize))
    })
}

/// Removes the oldest queued record at a port. `count` must be its number of fields. 1, or 0 if the
/// queue is empty, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or writable for `count` words, without other users during
/// the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_next(
    unit: *mut Unit,
    port: c_int,
    words: *mut i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            let fields = port_of(board, port)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, but the record has {fields} words"
                ));
            }
            let record = board.next(side(port)?);
            // SAFETY: guaranteed by the caller; it was checked.
            record
                .iter()
                .for_each(|record| unsafe { hand_over(record, words, count) });
            Ok(record.is_some().into())
        })
    })
}

/// `splatsim_unit_next` in 32-bit words, the least significant first; 0 above the record.
///
/// # Safety
/// As `splatsim_unit_next`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_next_bits(
    unit: *mut Unit,
    port: c_int,
    words: *mut u32,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            fits(port_of(board, port)?, count)?;
            let record = board.next(side(port)?);
            let Some(record) = record else { return Ok(0) };
            // SAFETY: guaranteed by the caller; it was checked.
            unsafe { hand_over(&packed(port_of(board, port)?, &record), words, count) };
            Ok(1)
        })
    })
}

fn fits(port: &Port, count: usize) -> CallResult<()> {
    let needed = halves(port);
    if count < needed {
        Err(format!(
            "count is {count}, but the record has {needed} words of 32 bits"
        ))
    } else {
        Ok(())
    }
}

/// Compares a device's record with the oldest queued record at a port, and removes that. Where only
/// the order per pixel matters, it is the oldest record of the same pixel. `count` must be its
/// number of fields. Fields without meaning in a record are not compared. 0 if they are equal; 1 if
/// they differ: `splatsim_last_error` returns the difference; -1 on failure: nothing is removed
/// then.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a pointer to `count` initialised words that do not
/// change during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_compare(
    unit: *mut Unit,
    port: c_int,
    words: *const i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        let compared = unit.with(|board| {
            let fields = port_of(board, port)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, but the record has {fields} words"
                ));
            }
            Ok(board.compare(side(port)?, words))
        })?;
        Ok(guarded(1, || compared.map(|()| 0)))
    })
}

/// `splatsim_unit_compare` for a record in 32-bit words, the least significant first.
///
/// # Safety
/// As `splatsim_unit_compare`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_compare_bits(
    unit: *mut Unit,
    port: c_int,
    words: *const u32,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        let compared = unit.with(|board| {
            let record = port_of(board, port)?
                .unpack(words)
                .map_err(|refused| refused.to_string())?;
            Ok(board.compare(side(port)?, &record))
        })?;
        Ok(guarded(1, || compared.map(|()| 0)))
    })
}

/// Makes a valid random input record: first corner cases and thresholds, then random ones, without
/// end. `count` must be its number of fields. 0, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or writable for `count` words, without other users during
/// the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_random(
    unit: *mut Unit,
    words: *mut i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            let fields = port_of(board, SPLATSIM_IN)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, but the record has {fields} words"
                ));
            }
            let record = board.made_up();
            // SAFETY: guaranteed by the caller; it was checked.
            unsafe { hand_over(&record, words, count) };
            Ok(0)
        })
    })
}

/// `splatsim_unit_random` in 32-bit words, the least significant first; 0 above the record.
///
/// # Safety
/// As `splatsim_unit_random`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_random_bits(
    unit: *mut Unit,
    words: *mut u32,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            fits(port_of(board, SPLATSIM_IN)?, count)?;
            let record = board.made_up();
            // SAFETY: guaranteed by the caller; it was checked.
            unsafe { hand_over(&packed(port_of(board, SPLATSIM_IN)?, &record), words, count) };
            Ok(0)
        })
    })
}

/// Writes record `number` of a constant of a frame ("frame", "light", "material" or "reflection")
/// in 32-bit words, the least significant first; 0 above the record. 1, or 0 if there is no record
/// of this number, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `name` NULL or a string that ends in 0, `words` NULL or writable for
/// `count` words, without other users during the call.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_constant_bits(
    unit: *const Unit,
    name: *const c_char,
    number: usize,
    words: *mut u32,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: guaranteed by the caller.
        let (unit, name) = unsafe { (held(unit, "unit")?, string(name, "name")?) };
        sound(words, count, "words")?;
        let (port, records) = unit.registers(name)?;
        fits(&port, count)?;
        let Some(record) = records.get(number) else {
            return Ok(0);
        };
        // SAFETY: guaranteed by the caller; it was checked.
        unsafe { hand_over(&packed(&port, record), words, count) };
        Ok(1)
    })
}
