//! An arm of three hinges with a fixed tool and a side branch, checked against sines and differences.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use super::{Inertial, JointKind, JointSpec, Link, Tree, TreeError};

fn link(name: &str, mass_kg: f64) -> Link {
    let inertial = Inertial {
        mass_kg,
        com_in_link_m: Vector3::new(0.1, -0.2, 0.3),
        inertia_about_com_kgm2: Matrix3::identity(),
    };
    Link { name: name.to_owned(), inertial: (mass_kg > 0.0).then_some(inertial) }
}

fn joint(name: &str, parent: &str, child: &str, axis: Option<Vector3<f64>>) -> JointSpec {
    let seed = f64::from(u32::from(name.as_bytes()[0]));
    JointSpec {
        name: name.to_owned(),
        parent: parent.to_owned(),
        child: child.to_owned(),
        parent_from_joint: Isometry3::from_parts(
            Translation3::new(0.3, 0.1, -0.4),
            UnitQuaternion::from_euler_angles(0.1 * seed, 0.2 * seed, 0.3 * seed),
        ),
        kind: axis.map_or(JointKind::Fixed, |axis| JointKind::Revolute { axis: Unit::new_normalize(axis) }),
    }
}

/// Links and joints in an order that is not the tree's.
fn arm() -> Tree {
    let links =
        vec![link("tool", 0.5), link("fore", 2.0), link("upper", 3.0), link("head", 4.0), link("base", 0.0)];
    let joints = vec![
        joint("wrist", "fore", "tool", None),
        joint("elbow", "upper", "fore", Some(Vector3::new(1.0, 2.0, -0.5))),
        joint("shoulder", "base", "upper", Some(Vector3::z())),
        joint("neck", "base", "head", Some(Vector3::y())),
    ];
    Tree::new(links, joints).unwrap()
}

fn root() -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(1.0, -2.0, 0.5),
        UnitQuaternion::from_euler_angles(0.4, -0.3, 2.0),
    )
}

#[test]
fn parents_come_first_and_siblings_keep_their_order() {
    let tree = arm();
    let names: Vec<_> = tree.links().iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["base", "upper", "fore", "tool", "head"]);
    let angles: Vec<_> = tree.joints().iter().map(|joint| (joint.name.as_str(), joint.angle_index)).collect();
    assert_eq!(angles, [("shoulder", Some(0)), ("elbow", Some(1)), ("wrist", None), ("neck", Some(2))]);
    for (index, joint) in tree.joints().iter().enumerate() {
        assert!(joint.parent < joint.child);
        assert_eq!(joint.child, index + 1);
        assert_eq!(tree.joint_above(joint.child), Some(joint));
    }
    assert_eq!(tree.joint_above(0), None);
    assert_eq!(tree.link_index("fore"), Some(2));
    assert_eq!(tree.link_index("leg"), None);
}

#[test]
fn a_hinge_turns_its_child_by_sine_and_cosine() {
    let specs = vec![JointSpec {
        parent_from_joint: Isometry3::translation(0.0, 0.0, 1.0),
        ..joint("hinge", "base", "arm", Some(Vector3::x()))
    }];
    let tree = Tree::new(vec![link("base", 0.0), link("arm", 1.0)], specs).unwrap();
    let angle: f64 = 0.7;
    let poses = tree.forward(&Isometry3::translation(0.0, 5.0, 0.0), &[angle]);
    let tip = poses[1] * Point3::new(0.0, 2.0, 0.0);
    let expected = Point3::new(0.0, 5.0 + 2.0 * angle.cos(), 1.0 + 2.0 * angle.sin());
    assert!((tip - expected).norm() < 1e-15, "{tip}");
}

#[test]
fn centre_of_mass_is_the_weighted_mean() {
    let tree = arm();
    assert_eq!(tree.total_mass_kg(), 9.5);
    let poses = tree.forward(&root(), &[0.3, -0.8, 1.2]);
    let com = |name| (poses[tree.link_index(name).unwrap()] * Point3::new(0.1, -0.2, 0.3)).coords;
    let expected = (com("upper") * 3.0 + com("fore") * 2.0 + com("tool") * 0.5 + com("head") * 4.0) / 9.5;
    assert!((tree.center_of_mass(&poses) - expected).norm() < 1e-14);
}

#[test]
fn point_jacobian_equals_central_differences() {
    let tree = arm();
    let angles = [0.3, -0.8, 1.2];
    let point_in_link = Point3::new(0.2, 0.5, -0.1);
    for link in 0..tree.links().len() {
        let point = |angles: &[f64]| (tree.forward(&root(), angles)[link] * point_in_link).coords;
        let poses = tree.forward(&root(), &angles);
        let jacobian = tree.point_jacobian(&poses, link, &point(&angles));
        assert_eq!(jacobian.ncols(), angles.len());
        for column in 0..angles.len() {
            let step = 1e-5;
            let mut shifted = angles;
            shifted[column] = angles[column] + step;
            let ahead = point(&shifted);
            shifted[column] = angles[column] - step;
            let difference = (ahead - point(&shifted)) / (2.0 * step);
            let error = (jacobian.column(column) - difference).norm();
            assert!(error < 1e-10, "link {link}, angle {column}: {error:e}");
        }
    }
}

#[test]
fn refuses_what_is_not_a_tree() {
    let links = || vec![link("a", 1.0), link("b", 1.0), link("c", 1.0)];
    let hinge = |name, parent, child| joint(name, parent, child, None);
    let error = |joints| Tree::new(links(), joints).unwrap_err();

    assert_eq!(Tree::new(vec![], vec![]).unwrap_err(), TreeError::Empty);
    assert_eq!(
        error(vec![hinge("j", "a", "b"), hinge("j", "b", "c")]),
        TreeError::DuplicateName { name: "j".to_owned() }
    );
    assert_eq!(
        error(vec![hinge("j", "a", "d")]),
        TreeError::UnknownLink { joint: "j".to_owned(), link: "d".to_owned() }
    );
    assert_eq!(
        error(vec![hinge("j", "a", "c"), hinge("k", "b", "c")]),
        TreeError::TwoParents { link: "c".to_owned() }
    );
    // Two parts, a cycle beside the root, a cycle of all.
    assert_eq!(
        error(vec![hinge("j", "a", "b")]),
        TreeError::ManyRoots { first: "a".to_owned(), second: "c".to_owned() }
    );
    assert_eq!(
        error(vec![hinge("j", "b", "c"), hinge("k", "c", "b")]),
        TreeError::Cycle { link: "b".to_owned() }
    );
    assert_eq!(
        error(vec![hinge("j", "a", "b"), hinge("k", "b", "c"), hinge("l", "c", "a")]),
        TreeError::Cycle { link: "a".to_owned() }
    );
}
