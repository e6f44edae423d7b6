//! Text: what went wrong, for the thread that asks; and the one door through which C enters.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Result of a call before it is told in C.
pub(crate) type Told<T> = Result<T, String>;

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs what C has asked for; `failed` where it went wrong, which is then this thread's last error.
pub(crate) fn guarded<T>(failed: T, work: impl FnOnce() -> Told<T>) -> T {
    let told = catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err("splatsim has failed: this is a fault of its own".into()));
    told.unwrap_or_else(|sentence| {
        remember(&sentence);
        failed
    })
}

fn remember(sentence: &str) {
    let text = CString::new(sentence.replace('\0', " ")).unwrap_or_default();
    // Where a thread is ending there is nobody left to ask.
    let _ = LAST.try_with(|last| *last.borrow_mut() = text);
}

/// Whether `count` numbers of this type may lie there.
pub(crate) fn sound<T>(numbers: *const T, count: usize, what: &str) -> Told<()> {
    if numbers.is_null() {
        return Err(format!("{what} is NULL"));
    }
    if !numbers.is_aligned() {
        return Err(format!(
            "{what} is at no address of a number of {} bits",
            8 * size_of::<T>()
        ));
    }
    if count
        .checked_mul(size_of::<T>())
        .is_none_or(|bytes| isize::try_from(bytes).is_err())
    {
        return Err(format!(
            "{what} has {count} numbers, and no memory holds so many"
        ));
    }
    Ok(())
}

/// What a C string says.
///
/// # Safety
/// NULL, or a pointer to a string that ends in 0.
pub(crate) unsafe fn string<'a>(text: *const c_char, what: &str) -> Told<&'a str> {
    if text.is_null() {
        return Err(format!("{what} is NULL"));
    }
    // SAFETY: the caller's.
    unsafe { CStr::from_ptr(text) }
        .to_str()
        .map_err(|_| format!("{what} is no UTF-8"))
}

/// Writes a text and a 0 behind it, where both fit; its bytes, without the 0.
///
/// # Safety
/// `text` is NULL or has room for `capacity` bytes.
pub(crate) unsafe fn hand_out(from: &str, text: *mut c_char, capacity: usize) -> Told<isize> {
    if text.is_null() && capacity != 0 {
        return Err("text is NULL, and capacity is not 0".into());
    }
    if capacity > from.len() {
        // SAFETY: the caller's; it is not NULL, and there is room for the text and a 0.
        unsafe {
            std::ptr::copy_nonoverlapping(from.as_ptr(), text.cast(), from.len());
            *text.add(from.len()) = 0;
        }
    }
    isize::try_from(from.len()).map_err(|_| "the text is too long".into())
}

/// What went wrong last in this thread, in a sentence; empty if nothing has. It stays until the
/// thread's next failure.
#[unsafe(no_mangle)]
pub extern "C" fn splatsim_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr())
        .unwrap_or(c"".as_ptr())
}

/// The version, such as 0.1.0.
#[unsafe(no_mangle)]
pub extern "C" fn splatsim_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
