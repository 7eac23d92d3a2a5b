//! Memory for large matrices: on huge pages where the system has them, and used again by the next batch.
//!
//! A batch at the sizes of the paper takes hundreds of megabytes for as long as one iteration. Fetched from the system and
//! handed back every time, each page of 4 kB would be cleared and mapped anew, and the processor would look up thousands of
//! page addresses at every step through time: together a fifth of an iteration.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use memmap2::MmapMut;
use rayon::prelude::*;

use crate::lanes::Number;

/// Bytes of a huge page.
const PAGE: usize = 2 << 20;

/// Bytes of a cache line; vectors that straddle two of them load at half speed.
pub(crate) const LINE: usize = 64;

/// Bytes from which on memory is mapped.
const LARGE: usize = PAGE / 2;

/// Mapped memory that nobody uses at present, the latest at the end.
struct Spare {
    maps: Vec<MmapMut>,
    /// Bytes in `maps`.
    kept: usize,
    /// Bytes of the maps in use.
    used: usize,
    /// The most bytes of maps that were in use at once; no more are ever mapped.
    most: usize,
}

static SPARE: Mutex<Spare> = Mutex::new(Spare { maps: Vec::new(), kept: 0, used: 0, most: 0 });

fn spare() -> MutexGuard<'static, Spare> {
    // Whatever panicked, the maps are whole.
    SPARE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Spare {
    /// Takes a map of at least so many bytes, the smallest there is, unless too much of it would lie idle.
    ///
    /// A larger one will do, or matrices that take turns would drive each other's maps out in every batch.
    fn take(&mut self, bytes: usize) -> Option<MmapMut> {
        let fitting = self
            .maps
            .iter()
            .enumerate()
            .rev()
            .filter(|(_, map)| (bytes..=bytes + bytes / 2).contains(&map.len()));
        let found = fitting.min_by_key(|(_, map)| map.len()).map(|(place, _)| place);
        let map = found.map(|place| self.maps.remove(place));
        if let Some(map) = &map {
            self.kept -= map.len();
        }
        self.used += map.as_ref().map_or(bytes, |map| map.len());
        self.most = self.most.max(self.used);
        self.shrink();
        map
    }

    fn give(&mut self, map: MmapMut) {
        self.used -= map.len();
        self.kept += map.len();
        self.maps.push(map);
        self.shrink();
    }

    /// Hands the oldest maps back to the system.
    fn shrink(&mut self) {
        while self.used + self.kept > self.most && !self.maps.is_empty() {
            self.kept -= self.maps.remove(0).len();
        }
    }
}

/// The size of the map that holds so many bytes: batches of about the same size get equal ones.
fn capacity(bytes: usize) -> usize {
    // A page more, so that the first one can begin where a huge page does.
    let step = (bytes.next_power_of_two() / 8).max(PAGE);
    bytes.next_multiple_of(step) + PAGE
}

/// Bytes from the beginning of a huge page to that of the numbers, another for every buffer: equal rows of matrices that all
/// began at a page would drive each other out of the caches.
fn stagger() -> usize {
    static BUFFERS: AtomicUsize = AtomicUsize::new(0);
    BUFFERS.fetch_add(1, Ordering::Relaxed).wrapping_mul(37) % 1024 * LINE
}

#[derive(Debug)]
enum Storage<T> {
    Small(Vec<T>),
    /// `None` only while it is dropped.
    Large(Option<MmapMut>),
}

/// Numbers that begin at a cache line.
#[derive(Debug)]
pub(crate) struct Buffer<T: Number> {
    storage: Storage<T>,
    /// First number.
    start: usize,
    len: usize,
}

impl<T: Number> Buffer<T> {
    pub(crate) fn zeros(len: usize) -> Self {
        Self::new(len, Some(0))
    }

    /// Numbers of which none is read before it is written; those of a debug build are no numbers.
    pub(crate) fn unset(len: usize) -> Self {
        Self::new(len, cfg!(debug_assertions).then_some(0xff))
    }

    /// Every byte is `fill`, where there is one.
    fn new(len: usize, fill: Option<u8>) -> Self {
        let bytes = len * size_of::<T>();
        match (bytes >= LARGE).then(|| Self::mapped(bytes, fill)).flatten() {
            Some((map, start)) => {
                let start = start / size_of::<T>();
                Self { storage: Storage::Large(Some(map)), start, len }
            }
            None => Self::small(len, fill.unwrap_or(0)),
        }
    }

    fn small(len: usize, fill: u8) -> Self {
        let mut data = vec![T::default(); len + LINE / size_of::<T>()];
        if fill != 0 {
            bytemuck::cast_slice_mut(&mut data).fill(fill);
        }
        let start = data.as_ptr().align_offset(LINE).min(LINE / size_of::<T>());
        Self { storage: Storage::Small(data), start, len }
    }

    /// A map and the byte of it where the numbers begin; none when the system has no memory to map.
    fn mapped(bytes: usize, fill: Option<u8>) -> Option<(MmapMut, usize)> {
        let capacity = capacity(bytes);
        let found = spare().take(capacity);
        let is_new = found.is_none();
        let Some(mut map) = found.or_else(|| MmapMut::map_anon(capacity).ok()) else {
            spare().used -= capacity;
            return None;
        };
        let page = map.as_ptr().align_offset(PAGE).min(capacity - bytes);
        let start = (page + stagger()).min(capacity - bytes) / LINE * LINE;
        if is_new {
            // Without huge pages it is slower, and nothing else.
            #[cfg(target_os = "linux")]
            let _ = map.advise(memmap2::Advice::HugePage);
        }
        if let Some(fill) = fill
            && !(is_new && fill == 0)
        {
            map[start..start + bytes].par_chunks_mut(LARGE).for_each(|bytes| bytes.fill(fill));
        }
        Some((map, start))
    }
}

impl<T: Number> Drop for Buffer<T> {
    fn drop(&mut self) {
        if let Storage::Large(map) = &mut self.storage
            && let Some(map) = map.take()
        {
            spare().give(map);
        }
    }
}

impl<T: Number> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        let mut clone = Self::unset(self.len);
        clone.copy_from_slice(self);
        clone
    }
}

impl<T: Number> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        let data = match &self.storage {
            Storage::Small(data) => data,
            Storage::Large(map) => map.as_deref().map_or(&[][..], whole),
        };
        &data[self.start..self.start + self.len]
    }
}

impl<T: Number> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        let data = match &mut self.storage {
            Storage::Small(data) => data,
            Storage::Large(map) => map.as_deref_mut().map_or(&mut [][..], whole_mut),
        };
        &mut data[self.start..self.start + self.len]
    }
}

/// Bytes as numbers; maps begin at a page and hold whole ones.
fn whole<T: Number>(bytes: &[u8]) -> &[T] {
    bytemuck::cast_slice(bytes)
}

fn whole_mut<T: Number>(bytes: &mut [u8]) -> &mut [T] {
    bytemuck::cast_slice_mut(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_zero_whoever_had_it_before() {
        for len in [3, 1000, LARGE / 4, 5 * PAGE / 4 + 7] {
            for _ in 0..3 {
                let mut buffer = Buffer::<f32>::zeros(len);
                assert_eq!((buffer.len(), buffer.as_ptr().align_offset(LINE)), (len, 0));
                assert!(buffer.iter().all(|&number| number == 0.0));
                buffer.fill(f32::NAN);
                let copy = buffer.clone();
                assert!(copy.len() == len && copy.iter().all(|number| number.is_nan()));
                assert_eq!(Buffer::<f32>::unset(len).len(), len);
            }
        }
    }

    #[test]
    fn no_more_is_kept_than_was_used_at_once() {
        let map = |bytes| MmapMut::map_anon(bytes).unwrap();
        let mut spare = Spare { maps: Vec::new(), kept: 0, used: 0, most: 0 };
        for bytes in [PAGE, 2 * PAGE] {
            assert!(spare.take(bytes).is_none());
        }
        spare.give(map(PAGE));
        spare.give(map(2 * PAGE));
        assert_eq!((spare.used, spare.kept, spare.most), (0, 3 * PAGE, 3 * PAGE));
        // What fits is used again; what does not drives the oldest out.
        assert_eq!(spare.take(2 * PAGE).map(|map| map.len()), Some(2 * PAGE));
        assert!(spare.take(4096).is_none());
        assert_eq!((spare.used, spare.kept), (2 * PAGE + 4096, 0));
    }

    #[test]
    fn what_takes_turns_is_mapped_once() {
        let mut spare = Spare { maps: Vec::new(), kept: 0, used: 0, most: 0 };
        let mut num_maps = 0;
        let mut take_and_give = |spare: &mut Spare, bytes: usize, count: usize| {
            let mut take = || {
                spare.take(bytes).unwrap_or_else(|| {
                    num_maps += 1;
                    MmapMut::map_anon(bytes).unwrap()
                })
            };
            let maps: Vec<_> = (0..count).map(|_| take()).collect();
            for map in maps {
                spare.give(map);
            }
            num_maps
        };
        let first = (take_and_give(&mut spare, 3 * PAGE, 4), take_and_give(&mut spare, 4 * PAGE, 3));
        assert_eq!(first, (4, 7));
        for _ in 0..3 {
            assert_eq!(take_and_give(&mut spare, 3 * PAGE, 3), 7);
            assert_eq!(take_and_give(&mut spare, 4 * PAGE, 3), 7);
        }
        assert!(spare.take(PAGE).is_none(), "too much of any map would lie idle");
    }

    #[test]
    fn batches_of_about_the_same_size_share_their_memory() {
        assert_eq!(capacity(1 << 20), 2 * PAGE);
        assert_eq!(capacity(45 << 20), capacity(47 << 20));
        assert!((1..60).all(|mib| capacity(mib << 20) <= (mib << 20) * 5 / 4 + 2 * PAGE));
    }
}
