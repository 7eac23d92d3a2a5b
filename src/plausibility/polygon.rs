//! Convex polygons on the floor.

use nalgebra::Vector2;

/// Corners of the convex hull, counter-clockwise, collinear points left out (Andrew 1979, Inf. Process. Lett. 9:216).
pub(super) fn convex_hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull = half_hull(points.iter());
    let upper = half_hull(points.iter().rev());
    // Each half ends where the other begins.
    hull.pop();
    hull.extend_from_slice(&upper[..upper.len() - 1]);
    hull
}

fn half_hull<'a>(points: impl Iterator<Item = &'a Vector2<f64>>) -> Vec<Vector2<f64>> {
    let mut half: Vec<Vector2<f64>> = Vec::new();
    for point in points {
        while let [.., before, last] = half[..]
            && (last - before).perp(&(point - last)) <= 0.0
        {
            half.pop();
        }
        half.push(*point);
    }
    half
}

/// Signed distance of a point from the edge of a hull, metres: positive inside; `None` for an empty hull.
///
/// A hull of one or two corners has no inside.
pub(super) fn margin_m(hull: &[Vector2<f64>], point: &Vector2<f64>) -> Option<f64> {
    let edges = || (0..hull.len()).map(|index| (hull[index], hull[(index + 1) % hull.len()]));
    let distance =
        edges().map(|(from, to)| distance_to_segment_m(&from, &to, point)).min_by(f64::total_cmp)?;
    let inside = hull.len() > 2 && edges().all(|(from, to)| (to - from).perp(&(point - from)) >= 0.0);
    Some(if inside { distance } else { -distance })
}

fn distance_to_segment_m(from: &Vector2<f64>, to: &Vector2<f64>, point: &Vector2<f64>) -> f64 {
    let along = to - from;
    let length = along.norm_squared();
    let share = if length > 0.0 { ((point - from).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (point - from - along * share).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(list: &[[f64; 2]]) -> Vec<Vector2<f64>> {
        list.iter().map(|&[x, y]| Vector2::new(x, y)).collect()
    }

    #[test]
    fn the_hull_of_a_square_is_its_corners() {
        let hull = convex_hull(points(&[
            [0.0, 0.0],
            [2.0, 2.0],
            [1.0, 1.0],
            [2.0, 0.0],
            [1.0, 0.0],
            [0.0, 2.0],
            [0.0, 2.0],
        ]));
        assert_eq!(hull, points(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]));
        let margin = |x, y| margin_m(&hull, &Vector2::new(x, y)).unwrap();
        assert!((margin(1.0, 1.0) - 1.0).abs() < 1e-12);
        assert!((margin(1.9, 0.5) - 0.1).abs() < 1e-12);
        assert!((margin(5.0, 6.0) + 5.0).abs() < 1e-12);
    }

    #[test]
    fn few_points_have_no_inside() {
        assert_eq!(margin_m(&[], &Vector2::zeros()), None);
        assert_eq!(margin_m(&convex_hull(points(&[[3.0, 4.0]])), &Vector2::zeros()), Some(-5.0));
        let line = convex_hull(points(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]));
        assert_eq!(line.len(), 2);
        assert_eq!(margin_m(&line, &Vector2::new(1.0, 0.5)), Some(-0.5));
    }
}
