//! Memory that is asked for before it is needed.

/// Asks for the line of memory at `number`, up to the second cache.
#[inline(always)]
pub(crate) fn fetch<T>(number: *const T) {
    hint::<2, T>(number);
}

/// Asks for the line of memory at `number`, up to the first cache.
#[inline(always)]
pub(crate) fn fetch_near<T>(number: *const T) {
    hint::<3, T>(number);
}

/// `CACHE` as the machine counts: 3 is the first.
#[inline(always)]
#[expect(unsafe_code, reason = "there is no other way to name memory that is needed soon")]
fn hint<const CACHE: i32, T>(number: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a hint, which reads nothing and cannot fault whatever the address.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<CACHE>(number.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = number;
}
