//! Which part of the data a motion belongs to, and the small draws from it.
//!
//! Every draw sorts by a checksum of seed, purpose and id, so it depends on nothing else: not on the order of files, the
//! number of threads, or the version of a random number generator.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::Split;

/// Place of an id in the random order that a seed and a purpose give.
pub(super) fn order_key(seed: u64, purpose: &str, id: &str) -> [u8; 32] {
    let mut digest = Sha256::new();
    digest.update(seed.to_le_bytes());
    digest.update((purpose.len() as u64).to_le_bytes());
    digest.update(purpose.as_bytes());
    digest.update(id.as_bytes());
    digest.finalize().into()
}

/// Splits ids by seed: of n, the first 80 % (rounded down) learn, 10 % (rounded down) validate, the rest test.
///
/// 2721 ids give 2176, 272 and 273, as in the paper.
pub(super) fn split_by_seed<'i>(ids: &[&'i str], seed: u64) -> BTreeMap<&'i str, Split> {
    let mut order: Vec<&str> = ids.to_vec();
    order.sort_by_key(|id| order_key(seed, "split", id));
    let (num_train, num_validation) = (order.len() * 8 / 10, order.len() / 10);
    let split = |place: usize| match place {
        _ if place < num_train => Split::Train,
        _ if place < num_train + num_validation => Split::Validation,
        _ => Split::Test,
    };
    order.into_iter().enumerate().map(|(place, id)| (id, split(place))).collect()
}

/// Why id files give no split.
#[derive(Debug, thiserror::Error)]
pub enum SplitError {
    /// A list cannot be read.
    #[error("read the split {}: {source}", .path.display())]
    Io {
        /// List.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An id that is to learn and to be tested.
    #[error("use the split {}: {id} is also in the list for {other:?}; a motion belongs to one split", .path.display())]
    Twice {
        /// The later list.
        path: PathBuf,
        /// The id.
        id: String,
        /// Split of the earlier list.
        other: Split,
    },
}

/// Reads one id a line from each list; blank lines are skipped.
pub(super) fn split_by_files(lists: &[(Split, PathBuf)]) -> Result<BTreeMap<String, Split>, SplitError> {
    let mut splits = BTreeMap::new();
    for (split, path) in lists {
        for id in read_list(path)?.lines().map(str::trim).filter(|id| !id.is_empty()) {
            match splits.insert(id.to_owned(), *split) {
                Some(other) if other != *split => {
                    return Err(SplitError::Twice { path: path.clone(), id: id.to_owned(), other });
                }
                _ => {}
            }
        }
    }
    Ok(splits)
}

fn read_list(path: &Path) -> Result<String, SplitError> {
    // A list of a million ids is smaller than this.
    const MAX_BYTES: u64 = 64 << 20;
    let io_error = |source| SplitError::Io { path: path.to_owned(), source };
    if std::fs::metadata(path).map_err(io_error)?.len() > MAX_BYTES {
        return Err(io_error(std::io::Error::other(format!("larger than {MAX_BYTES} bytes"))));
    }
    std::fs::read_to_string(path).map_err(io_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_numbers_come_out() {
        let ids: Vec<String> = (0..2721).map(|id| format!("{id:05}")).collect();
        let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
        let splits = split_by_seed(&ids, 0);
        let count = |split| splits.values().filter(|found| **found == split).count();
        assert_eq!([Split::Train, Split::Validation, Split::Test].map(count), [2176, 272, 273]);
        assert_eq!(splits, split_by_seed(&ids, 0));
        assert_ne!(splits, split_by_seed(&ids, 1));
        let reversed: Vec<&str> = ids.iter().rev().copied().collect();
        assert_eq!(splits, split_by_seed(&reversed, 0));
    }

    #[test]
    fn lists_must_not_overlap() {
        let folder = tempfile::tempdir().unwrap();
        let list = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let train = list("train.txt", "1\n2\n\n2\n");
        let splits =
            split_by_files(&[(Split::Train, train.clone()), (Split::Test, list("test.txt", "3\r\n"))]);
        assert_eq!(
            splits.unwrap().into_iter().collect::<Vec<_>>(),
            [("1".to_owned(), Split::Train), ("2".to_owned(), Split::Train), ("3".to_owned(), Split::Test)]
        );
        let error =
            split_by_files(&[(Split::Train, train), (Split::Test, list("test.txt", "2"))]).unwrap_err();
        assert!(error.to_string().contains("2 is also in the list for Train"), "{error}");
        assert!(split_by_files(&[(Split::Test, folder.path().join("none"))]).is_err());
    }
}
