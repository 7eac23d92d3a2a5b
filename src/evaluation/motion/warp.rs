//! Dynamic time warping (Sakoe and Chiba 1978).

/// Cheapest sum of costs along a path so far, and the cells of that path.
#[derive(Debug, Clone, Copy)]
struct Path {
    cost: f64,
    cells: usize,
}

/// Mean cost along the cheapest path from the first cell to the last, by steps of one row, one column, or both.
///
/// The path has the smallest sum (each cell counts once, whatever step led to it); its mean divides by its cells.
/// Takes `rows * columns` costs and the memory of two rows.
///
/// # Panics
/// If there is no row or no column.
pub(super) fn mean_along_path(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> f64 {
    assert!(rows > 0 && columns > 0, "something to align");
    let mut above: Vec<Path> = Vec::new();
    for row in 0..rows {
        let mut here: Vec<Path> = Vec::with_capacity(columns);
        for column in 0..columns {
            let diagonal = column.checked_sub(1).and_then(|before| above.get(before));
            let before = [diagonal, above.get(column), here.last()].into_iter().flatten();
            let best =
                before.copied().reduce(|best, other| if other.cost < best.cost { other } else { best });
            let best = best.unwrap_or(Path { cost: 0.0, cells: 0 });
            here.push(Path { cost: best.cost + cost(row, column), cells: best.cells + 1 });
        }
        above = here;
    }
    let end = above[columns - 1];
    end.cost / end.cells as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aligned(a: &[f64], b: &[f64]) -> f64 {
        mean_along_path(a.len(), b.len(), |row, column| (a[row] - b[column]).abs())
    }

    #[test]
    fn hand_worked_paths() {
        assert_eq!(aligned(&[1.0, 2.0, 3.0], &[1.0, 2.0, 3.0]), 0.0);
        // A value held for longer costs nothing.
        assert_eq!(aligned(&[1.0, 2.0, 3.0], &[1.0, 1.0, 2.0, 2.0, 2.0, 3.0]), 0.0);
        // Every cell of the only path costs 1: 0-1, 0-1.
        assert_eq!(aligned(&[0.0], &[1.0, 1.0]), 1.0);
        // 0-0, 0-0, 5-4: 1 over three cells.
        assert!((aligned(&[0.0, 5.0], &[0.0, 0.0, 4.0]) - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_late_sine_is_aligned() {
        let sine =
            |late: f64| -> Vec<f64> { (0..200).map(|step| (0.1 * f64::from(step) - late).sin()).collect() };
        let (now, late) = (sine(0.0), sine(1.0));
        let plain = now.iter().zip(&late).map(|(a, b)| (a - b).abs()).sum::<f64>() / 200.0;
        assert!(aligned(&now, &late) < 0.15 * plain, "{} of {plain}", aligned(&now, &late));
    }
}
