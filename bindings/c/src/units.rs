//! Units: one unit of a machine, words in and words out, and what it gave held against a device's
//! records.

use crate::handles::{Machine, Scene, freed, handle, held, is_shared, locked, sentence};
use crate::text::{Told, guarded, hand_out, sound, string};
use self_cell::self_cell;
use splatsim::cosim::live::{Constants, Port, Record};
use splatsim::cosim::scoreboard::{PortSide, Scoreboard};
use std::ffi::{c_char, c_int};
use std::sync::Mutex;

/// A unit by itself, and the records that it gave and nobody has taken.
pub struct Unit(Mutex<Cell>);

self_cell!(
    struct Cell {
        owner: Constants,
        #[covariant]
        dependent: Scoreboard,
    }
);

const _: () = is_shared::<Unit>();

/// Port: what a unit takes.
pub const SPLATSIM_IN: c_int = 0;
/// Port: what it gives for that.
pub const SPLATSIM_OUT: c_int = 1;
/// Port: what fragment asks shade.
pub const SPLATSIM_REQUEST: c_int = 2;
/// Port: what that says.
pub const SPLATSIM_ANSWER: c_int = 3;
/// Port: what fragment holds in the end.
pub const SPLATSIM_HELD: c_int = 4;

fn side(port: c_int) -> Told<PortSide> {
    let side = usize::try_from(port)
        .ok()
        .and_then(|port| PortSide::ALL.get(port).copied());
    side.ok_or_else(|| {
        format!("there is no port {port}: 0 is in, 1 out, 2 request, 3 answer, 4 held")
    })
}

impl Unit {
    pub(crate) fn with<T>(&self, work: impl FnOnce(&mut Scoreboard) -> Told<T>) -> Told<T> {
        locked(&self.0).with_dependent_mut(|_, board| work(board))
    }

    /// What is constant in a frame: its port and its records.
    fn registers(&self, name: &str) -> Told<(Port, Vec<Record>)> {
        let found = locked(&self.0).with_dependent(|constants, _| constants.registers(name));
        found.ok_or_else(|| {
            format!("{name} is not constant in a frame: frame, light, material and reflection are")
        })
    }
}

/// A port of a unit, which it must have.
fn port_of<'a>(board: &'a Scoreboard, port: c_int) -> Told<&'a Port> {
    board
        .port(side(port)?)
        .ok_or_else(|| format!("{} has no port {port}", board.name()))
}

/// `count` numbers.
///
/// # Safety
/// `words` is NULL or points to so many that were written, which nobody changes meanwhile.
unsafe fn given<'a, T>(words: *const T, count: usize) -> Told<&'a [T]> {
    sound(words, count, "words")?;
    // SAFETY: the caller's; NULL, the address and the size were checked.
    Ok(unsafe { std::slice::from_raw_parts(words, count) })
}

/// Writes numbers to `words`, and 0 above them; as many as fit. What was there may never have been
/// written: no slice is made of it.
///
/// # Safety
/// [`sound`] of them, and there is room for `count` numbers, which nobody else uses.
unsafe fn hand_over<T: Copy + Default>(from: &[T], words: *mut T, count: usize) {
    for place in 0..count {
        // SAFETY: the caller's.
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

/// The unit of a machine by its name, such as "raster", with registers, lights and materials of a
/// scene. Random records depend on `seed`. NULL where there is no such unit. Machine and scene may
/// be freed before it is.
///
/// # Safety
/// All are NULL or what their types say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_new(
    machine: *const Machine,
    scene: *const Scene,
    name: *const c_char,
    seed: u64,
) -> *mut Unit {
    guarded(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
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

/// Frees a unit; NULL is nothing.
///
/// # Safety
/// `unit` is NULL or a unit, and used by nobody any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_free(unit: *mut Unit) {
    // SAFETY: the caller's.
    unsafe { freed(unit) }
}

/// Words of a record of a port, SPLATSIM_IN and so on: one for each field. -1 where the unit has no
/// such port.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_fields(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: the caller's.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(port_of(board, port)?.fields() as isize))
    })
}

/// Bits of a record of a port. -1 where the unit has no such port.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_width(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: the caller's.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(port_of(board, port)?.width() as isize))
    })
}

/// Writes a field's name, and a 0, into `text` if `capacity` is greater than the count that is
/// returned: bytes without the 0. -1 on failure.
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
        // SAFETY: the caller's.
        let name = unsafe { held(unit, "unit") }?.with(|board| {
            let field = port_of(board, port)?.stream.fields.get(field);
            field
                .map(|field| field.name.clone())
                .ok_or_else(|| "there is no such field".into())
        })?;
        // SAFETY: the caller's.
        unsafe { hand_out(&name, text, capacity) }
    })
}

/// Gives the unit a record, a word for each field. What comes of it waits until it is taken
/// (`splatsim_unit_next`) or compared, at every port: fragment's requests and answers too, which
/// grow in number where nobody takes them. The number of records that wait at SPLATSIM_OUT, or -1
/// where the unit was never given such a record: nothing has happened then.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a pointer to `count` words that were written, which
/// nobody changes meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_step(
    unit: *mut Unit,
    words: *const i64,
    count: usize,
) -> isize {
    guarded(-1, || {
        // SAFETY: the caller's.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        unit.with(|board| step(board, words))
    })
}

/// The same with a record as a trace's line has it, in 32-bit words, the least significant first.
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
        // SAFETY: the caller's.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        unit.with(|board| {
            let record = port_of(board, SPLATSIM_IN)?
                .unpack(words)
                .map_err(|refused| refused.to_string())?;
            step(board, &record)
        })
    })
}

fn step(board: &mut Scoreboard, words: &[i64]) -> Told<isize> {
    board.step(words).map_err(|refused| refused.to_string())?;
    Ok(board.waiting(PortSide::Out) as isize)
}

/// Ends a frame: fragment gives what it holds, sort what it has sorted, and both are empty. The
/// number of records that wait at SPLATSIM_OUT and SPLATSIM_HELD, or -1 where a pixel's last layer
/// is missing.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_end(unit: *mut Unit) -> isize {
    guarded(-1, || {
        // SAFETY: the caller's.
        unsafe { held(unit, "unit") }?.with(|board| {
            board.end().map_err(|refused| refused.to_string())?;
            Ok((board.waiting(PortSide::Out) + board.waiting(PortSide::Held)) as isize)
        })
    })
}

/// Number of records that wait at a port. -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_waiting(unit: *const Unit, port: c_int) -> isize {
    // SAFETY: the caller's.
    guarded(-1, || {
        unsafe { held(unit, "unit") }?.with(|board| Ok(board.waiting(side(port)?) as isize))
    })
}

/// Takes the record that has waited longest at a port. `count` must be its number of fields. 1, or
/// 0 where none waits, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a place for `count` words, which nobody else uses
/// meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_next(
    unit: *mut Unit,
    port: c_int,
    words: *mut i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            let fields = port_of(board, port)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, and the record has {fields} words"
                ));
            }
            let record = board.next(side(port)?);
            // SAFETY: the caller's; it was checked.
            record
                .iter()
                .for_each(|record| unsafe { hand_over(record, words, count) });
            Ok(record.is_some().into())
        })
    })
}

/// The same as 32-bit words, the least significant first; 0 above the record.
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
        // SAFETY: the caller's.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            fits(port_of(board, port)?, count)?;
            let record = board.next(side(port)?);
            let Some(record) = record else { return Ok(0) };
            // SAFETY: the caller's; it was checked.
            unsafe { hand_over(&packed(port_of(board, port)?, &record), words, count) };
            Ok(1)
        })
    })
}

fn fits(port: &Port, count: usize) -> Told<()> {
    let needed = halves(port);
    if count < needed {
        Err(format!(
            "count is {count}, and the record has {needed} words of 32 bits"
        ))
    } else {
        Ok(())
    }
}

/// Compares a device's record with the one that has waited longest at a port (where order counts at
/// each pixel only, at its pixel), and takes that away. `count` must be its number of fields. What
/// means nothing in a record is not compared. 0 where they are equal, 1 where they differ:
/// `splatsim_last_error` says how; -1 on failure: nothing is taken then.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a pointer to `count` words that were written, which
/// nobody changes meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_compare(
    unit: *mut Unit,
    port: c_int,
    words: *const i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let (unit, words) = unsafe { (held(unit, "unit")?, given(words, count)?) };
        let compared = unit.with(|board| {
            let fields = port_of(board, port)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, and the record has {fields} words"
                ));
            }
            Ok(board.compare(side(port)?, words))
        })?;
        Ok(guarded(1, || compared.map(|()| 0)))
    })
}

/// The same with a record in 32-bit words, the least significant first.
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
        // SAFETY: the caller's.
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

/// Makes up a record that the unit may be given: corners and thresholds on purpose, then random
/// ones, for ever. `count` must be its number of fields. 0, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `words` NULL or a place for `count` words, which nobody else uses
/// meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_random(
    unit: *mut Unit,
    words: *mut i64,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            let fields = port_of(board, SPLATSIM_IN)?.fields();
            if count != fields {
                return Err(format!(
                    "count is {count}, and the record has {fields} words"
                ));
            }
            let record = board.made_up();
            // SAFETY: the caller's; it was checked.
            unsafe { hand_over(&record, words, count) };
            Ok(0)
        })
    })
}

/// The same as 32-bit words, the least significant first; 0 above the record.
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
        // SAFETY: the caller's.
        let unit = unsafe { held(unit, "unit") }?;
        sound(words, count, "words")?;
        unit.with(|board| {
            fits(port_of(board, SPLATSIM_IN)?, count)?;
            let record = board.made_up();
            // SAFETY: the caller's; it was checked.
            unsafe { hand_over(&packed(port_of(board, SPLATSIM_IN)?, &record), words, count) };
            Ok(0)
        })
    })
}

/// Record `number` of what is constant in a frame ("frame", "light", "material" or "reflection"),
/// as 32-bit words, the least significant first; 0 above the record. 1, or 0 where there is none of
/// this number, or -1 on failure.
///
/// # Safety
/// `unit` is NULL or a unit, `name` NULL or a string that ends in 0, `words` NULL or a place for
/// `count` words, which nobody else uses meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn splatsim_unit_constant_bits(
    unit: *const Unit,
    name: *const c_char,
    number: usize,
    words: *mut u32,
    count: usize,
) -> c_int {
    guarded(-1, || {
        // SAFETY: the caller's.
        let (unit, name) = unsafe { (held(unit, "unit")?, string(name, "name")?) };
        sound(words, count, "words")?;
        let (port, records) = unit.registers(name)?;
        fits(&port, count)?;
        let Some(record) = records.get(number) else {
            return Ok(0);
        };
        // SAFETY: the caller's; it was checked.
        unsafe { hand_over(&packed(&port, record), words, count) };
        Ok(1)
    })
}
