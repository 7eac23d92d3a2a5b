//! Random numbers that are the same everywhere.

use sha2::{Digest, Sha256};

/// A stream of random numbers that depends on a seed, what it is for, and a count, and on nothing drawn elsewhere.
///
/// Nothing random has to be kept between iterations: a run that goes on after a stop draws what it would have drawn.
/// Splitmix (Steele, Lea, Flood 2014), begun at a checksum of the three.
pub struct Draws(u64);

impl Draws {
    /// The stream of a seed for a purpose, such as `"captions"`, and a count, such as the epoch.
    #[must_use]
    pub fn new(seed: u64, purpose: &str, count: u64) -> Self {
        let mut hash = Sha256::new();
        hash.update(seed.to_le_bytes());
        hash.update(count.to_le_bytes());
        hash.update(purpose.as_bytes());
        Self(hash.finalize().iter().take(8).fold(0, |state, &byte| state << 8 | u64::from(byte)))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        // 53 bits fill the mantissa.
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number below `bound`, which is not 0. The bias is below `bound / 2^64`.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.next()) * bound as u128) >> 64) as usize
    }

    /// Brings some items into random order.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }

    /// Normally distributed numbers of mean 0 and variance 1 (Box and Muller 1958).
    pub fn normal(&mut self, count: usize) -> Vec<f32> {
        let mut numbers = Vec::with_capacity(count + 1);
        while numbers.len() < count {
            // 1 - unit is never 0.
            let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
            let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
            numbers.extend([(radius * cos) as f32, (radius * sin) as f32]);
        }
        numbers.truncate(count);
        numbers
    }

    /// Numbers in `[-bound, bound)`.
    pub fn uniform(&mut self, count: usize, bound: f32) -> Vec<f32> {
        (0..count).map(|_| ((2.0 * self.unit() - 1.0) as f32) * bound).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_its_seed_purpose_and_count() {
        let draw = |seed, purpose, count| Draws::new(seed, purpose, count).unit();
        assert_eq!(draw(1, "captions", 0), draw(1, "captions", 0));
        assert_ne!(draw(1, "captions", 0), draw(2, "captions", 0));
        assert_ne!(draw(1, "captions", 0), draw(1, "motions", 0));
        assert_ne!(draw(1, "captions", 0), draw(1, "captions", 1));
    }

    #[test]
    fn numbers_are_those_of_the_reference() {
        // First numbers of splitmix64 begun at 1234567, as its authors' program prints them.
        let mut draws = Draws(1234567);
        assert_eq!(
            [draws.next(), draws.next(), draws.next()],
            [6457827717110365317, 3203168211198807973, 9817491932198370423]
        );
    }

    #[test]
    fn normal_numbers_have_the_right_moments() {
        let numbers = Draws::new(5, "normal", 0).normal(10_001);
        let moment = |power| numbers.iter().map(|&n| f64::from(n).powi(power)).sum::<f64>() / 10_001.0;
        // Four standard errors: 0.04, 0.057, 0.39.
        assert!(numbers.len() == 10_001 && moment(1).abs() < 0.04);
        assert!((moment(2) - 1.0).abs() < 0.057 && (moment(4) - 3.0).abs() < 0.4);
    }

    #[test]
    fn a_shuffle_keeps_every_item_and_favours_none() {
        let mut first_places = [0; 4];
        for count in 0..4000 {
            let mut items = [0, 1, 2, 3];
            Draws::new(3, "shuffle", count).shuffle(&mut items);
            first_places[items[0]] += 1;
            items.sort_unstable();
            assert_eq!(items, [0, 1, 2, 3]);
        }
        for places in first_places {
            // Four standard deviations of 1000 draws.
            assert!((890..1110).contains(&places), "{first_places:?}");
        }
    }
}
