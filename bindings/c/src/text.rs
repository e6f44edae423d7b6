//! Text: the last error of a thread, and the guard around every call from C.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Result of a call before it is converted for C.
pub(crate) type CallResult<T> = Result<T, String>;

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs the work of a call. Returns `failed` on an error, which becomes this thread's last error.
pub(crate) fn guarded<T>(failed: T, work: impl FnOnce() -> CallResult<T>) -> T {
    let result = catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err("splatsim has failed: this is a bug".into()));
    result.unwrap_or_else(|sentence| {
        remember(&sentence);
        failed
    })
}

fn remember(sentence: &str) {
    let text = CString::new(sentence.replace('\0', " ")).unwrap_or_default();
    // A thread that is ending has no last error.
    let _ = LAST.try_with(|last| *last.borrow_mut() = text);
}

/// Whether `count` numbers of this type can be at this address.
pub(crate) fn sound<T>(numbers: *const T, count: usize, what: &str) -> CallResult<()> {
    if numbers.is_null() {
        return Err(format!("{what} is NULL"));
    }
    if !numbers.is_aligned() {
        return Err(format!(
            "{what} is not aligned for numbers of {} bits",
            8 * size_of::<T>()
        ));
    }
    if count
        .checked_mul(size_of::<T>())
        .is_none_or(|bytes| isize::try_from(bytes).is_err())
    {
        return Err(format!(
            "{what} has {count} numbers, more than memory can hold"
        ));
    }
    Ok(())
}

/// Text of a C string.
///
/// # Safety
/// NULL, or a pointer to a string that ends in 0.
pub(crate) unsafe fn string<'a>(text: *const c_char, what: &str) -> CallResult<&'a str> {
    if text.is_null() {
        return Err(format!("{what} is NULL"));
    }
    // SAFETY: guaranteed by the caller.
    unsafe { CStr::from_ptr(text) }
        .to_str()
        .map_err(|_| format!("{what} is not UTF-8"))
}

/// Writes a text with a terminating 0, if both fit; returns its bytes, without the 0.
///
/// # Safety
/// `text` is NULL or has room for `capacity` bytes.
pub(crate) unsafe fn hand_out(from: &str, text: *mut c_char, capacity: usize) -> CallResult<isize> {
    if text.is_null() && capacity != 0 {
        return Err("text is NULL, but capacity is not 0".into());
    }
    if capacity > from.len() {
        // SAFETY: guaranteed by the caller; it is not NULL, and there is room for the text and a 0.
        unsafe {
            std::ptr::copy_nonoverlapping(from.as_ptr(), text.cast(), from.len());
            *text.add(from.len()) = 0;
        }
    }
    isize::try_from(from.len()).map_err(|_| "the text is too long".into())
}

/// The last error of this thread, in a sentence; empty if there was none. It is valid until the
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
