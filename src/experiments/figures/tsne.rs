//! t-SNE (van der Maaten and Hinton 2008), exact.
//!
//! From principal components instead of random places (Kobak and Berens 2019), so the picture is the same every time and
//! far groups keep their order. Takes the square of the number of points in time and memory.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::evaluation::motion::Embeddings;

/// Steps of gradient descent, the first of them with exaggerated attraction.
const STEPS: usize = 1000;
const EXAGGERATED_STEPS: usize = 250;
const EXAGGERATION: f64 = 12.0;

/// Places of the points in the plane; `perplexity` is the number of neighbours that count, lowered to a third of the points
/// where they are few.
#[must_use]
pub fn tsne(points: &Embeddings, perplexity: f64) -> Vec<[f64; 2]> {
    let num = points.len();
    if num < 4 {
        return principal_components(points);
    }
    let affinities = affinities(points, perplexity.min((num - 1) as f64 / 3.0).max(1.0));
    let mut places = principal_components(points);
    // The descent begins near the middle, where all points still reach each other.
    let spread = (places.iter().map(|place| place[0] * place[0]).sum::<f64>() / num as f64).sqrt();
    for place in &mut places {
        *place = place.map(|value| value * 1e-4 / spread.max(1e-12));
    }
    let rate = (num as f64 / EXAGGERATION / 4.0).max(50.0);
    let mut moves = vec![[0.0; 2]; num];
    let mut gains = vec![[1.0_f64; 2]; num];
    for step in 0..STEPS {
        let (exaggeration, momentum) =
            if step < EXAGGERATED_STEPS { (EXAGGERATION, 0.5) } else { (1.0, 0.8) };
        let slopes = slopes(&affinities, &places, exaggeration);
        for index in 0..num {
            for axis in 0..2 {
                let (slope, before) = (slopes[index][axis], moves[index][axis]);
                let gain = &mut gains[index][axis];
                *gain = if slope * before < 0.0 { *gain + 0.2 } else { (*gain * 0.8).max(0.01) };
                moves[index][axis] = momentum * before - rate * *gain * slope;
                places[index][axis] += moves[index][axis];
            }
        }
    }
    places
}

/// The two directions of largest spread, each with its largest entry positive.
fn principal_components(points: &Embeddings) -> Vec<[f64; 2]> {
    let (num, width) = (points.len(), points.dimensions());
    let matrix = DMatrix::from_fn(num, width, |row, column| points.row(row)[column]);
    let mean = matrix.row_mean();
    let centred = DMatrix::from_fn(num, width, |row, column| matrix[(row, column)] - mean[column]);
    let eigen = SymmetricEigen::new(centred.tr_mul(&centred));
    let mut order: Vec<usize> = (0..width).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |place: usize| {
        order.get(place).map(|&column| {
            let axis = eigen.eigenvectors.column(column).into_owned();
            if axis[axis.icamax()] < 0.0 { -axis } else { axis }
        })
    };
    let axes = [axis(0), axis(1)];
    (0..num)
        .map(|row| {
            let along = |place: usize| {
                axes[place].as_ref().map_or(0.0, |axis| centred.row(row).transpose().dot(axis))
            };
            [along(0), along(1)]
        })
        .collect()
}

/// Symmetric probabilities of being neighbours, `[point, point]`, summing to 1.
fn affinities(points: &Embeddings, perplexity: f64) -> Vec<f64> {
    let num = points.len();
    let mut conditional = vec![0.0; num * num];
    for index in 0..num {
        let squares: Vec<f64> = (0..num).map(|other| points.distance(index, points, other).powi(2)).collect();
        let nearest =
            squares.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, square)| *square);
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        let row = &mut conditional[index * num..(index + 1) * num];
        // The width of the bell at which so many neighbours count, by halving.
        let (mut low, mut high, mut width) = (0.0, f64::INFINITY, 1.0);
        for _ in 0..200 {
            let mut total = 0.0;
            for (other, slot) in row.iter_mut().enumerate() {
                *slot = if other == index { 0.0 } else { (-(squares[other] - nearest) * width).exp() };
                total += *slot;
            }
            let mut entropy = 0.0;
            for slot in row.iter_mut() {
                *slot /= total;
                if *slot > 0.0 {
                    entropy -= *slot * slot.ln();
                }
            }
            let excess = entropy - perplexity.ln();
            if excess.abs() < 1e-5 {
                break;
            }
            if excess > 0.0 {
                low = width;
                width = if high.is_finite() { f64::midpoint(low, high) } else { width * 2.0 };
            } else {
                high = width;
                width = f64::midpoint(low, high);
            }
        }
    }
    (0..num * num)
        .map(|cell| {
            let (row, column) = (cell / num, cell % num);
            (conditional[cell] + conditional[column * num + row]) / (2 * num) as f64
        })
        .collect()
}

fn slopes(affinities: &[f64], places: &[[f64; 2]], exaggeration: f64) -> Vec<[f64; 2]> {
    let num = places.len();
    let closeness = |a: [f64; 2], b: [f64; 2]| 1.0 / (1.0 + (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2));
    let mut total = 0.0;
    for (index, &place) in places.iter().enumerate() {
        total += 2.0 * places[..index].iter().map(|&other| closeness(place, other)).sum::<f64>();
    }
    places
        .iter()
        .enumerate()
        .map(|(index, &place)| {
            let mut slope = [0.0; 2];
            for (other, &there) in places.iter().enumerate() {
                let close = closeness(place, there);
                let pull = exaggeration * affinities[index * num + other] - close / total;
                for axis in 0..2 {
                    slope[axis] += 4.0 * pull * close * (place[axis] - there[axis]);
                }
            }
            slope
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::SplitMix64;

    /// Three clouds far apart in ten dimensions, fifteen points each.
    fn clouds() -> Embeddings {
        let mut random = SplitMix64(5);
        let point = |index: usize, random: &mut SplitMix64| -> Vec<f32> {
            (0..10).map(|axis| random.share() as f32 + if axis == index / 15 { 8.0 } else { 0.0 }).collect()
        };
        Embeddings::new(&(0..45).map(|index| point(index, &mut random)).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn clouds_stay_apart() {
        let places = tsne(&clouds(), 10.0);
        let distance = |a: usize, b: usize| (places[a][0] - places[b][0]).hypot(places[a][1] - places[b][1]);
        for index in 0..45 {
            let nearest = (0..45)
                .filter(|&other| other != index)
                .min_by(|&a, &b| distance(index, a).total_cmp(&distance(index, b)));
            assert_eq!(nearest.unwrap() / 15, index / 15, "point {index}");
        }
    }

    #[test]
    fn rows_of_affinities_have_the_perplexity() {
        let found = affinities(&clouds(), 10.0);
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!((0..45).all(|index| found[index * 45 + index] == 0.0));
    }

    #[test]
    fn few_or_equal_points_are_no_error() {
        let same = Embeddings::new(&vec![vec![1.0, 2.0]; 6]).unwrap();
        assert!(tsne(&same, 30.0).iter().flatten().all(|value| value.is_finite()));
        assert_eq!(tsne(&Embeddings::new(&[vec![1.0]]).unwrap(), 30.0), [[0.0, 0.0]]);
    }
}
