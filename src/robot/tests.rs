//! A pendulum and its faults.

use nalgebra::{Isometry3, Vector3};

use super::{Shape, parse_urdf};

const PENDULUM: &str = r#"<?xml version="1.0"?>
<robot name="pendulum">
  <!-- A rod of 2 kg and 1 m on a hinge 2 m above the ground. -->
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
      <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.01"/></inertial>
    <visual><geometry><mesh filename="rod.dae"/></geometry></visual>
    <collision><origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.05" length="1"/></geometry></collision>
  </link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="0 0 2"/>
    <axis xyz="2 0 0"/><limit lower="-1" upper="1" effort="10" velocity="5"/></joint>
  <transmission name="drive"/>
</robot>"#;

#[test]
fn reads_a_pendulum_and_swings_it_forward() {
    let robot = parse_urdf(PENDULUM).unwrap();
    assert_eq!(robot.name, "pendulum");
    assert_eq!(robot.tree.num_angles(), 1);
    let limits = robot.limits[0];
    assert_eq!((limits.lower_rad, limits.upper_rad), (-1.0, 1.0));
    assert_eq!((limits.effort_nm, limits.velocity_rad_s), (10.0, 5.0));
    assert_eq!(robot.collisions[0], []);
    assert_eq!(robot.collisions[1][0].shape, Shape::Cylinder { radius_m: 0.05, length_m: 1.0 });
    let poses = robot.tree.forward(&Isometry3::identity(), &[std::f64::consts::FRAC_PI_2]);
    // A rod hanging down turns about x: down (-z) goes to forward (+y).
    let com = robot.tree.center_of_mass(&poses);
    assert!((com - Vector3::new(0.0, 0.5, 2.0)).norm() < 1e-12, "{com}");
}

#[test]
fn order_of_elements_does_not_matter() {
    let collision = r#"<origin xyz="0 0 -0.5"/><geometry><cylinder radius="0.05" length="1"/></geometry>"#;
    let swapped = r#"<geometry><cylinder radius="0.05" length="1"/></geometry><origin xyz="0 0 -0.5"/>"#;
    assert!(PENDULUM.contains(collision));
    assert_eq!(parse_urdf(&PENDULUM.replace(collision, swapped)).unwrap(), parse_urdf(PENDULUM).unwrap());

    let base = r#"<link name="base"/>"#;
    let last = PENDULUM.replace(base, "").replace("<transmission", &format!("{base}<transmission"));
    assert_eq!(parse_urdf(&last).unwrap(), parse_urdf(PENDULUM).unwrap());
}

#[test]
fn a_continuous_joint_has_no_limits_it_does_not_state() {
    let limit = r#"<limit lower="-1" upper="1" effort="10" velocity="5"/>"#;
    let free = PENDULUM.replace("revolute", "continuous");
    let limits = parse_urdf(&free).unwrap().limits[0];
    assert_eq!((limits.upper_rad, limits.effort_nm), (f64::INFINITY, 10.0));
    let limits = parse_urdf(&free.replace(limit, "")).unwrap().limits[0];
    assert_eq!((limits.lower_rad, limits.velocity_rad_s), (f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn refuses_what_it_cannot_represent_and_names_it() {
    let rod = r#"<link name="rod">"#;
    let second_hinge = |parent: &str, child: &str| {
        let joint = format!(
            r#"<joint name="second" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>"#
        );
        PENDULUM.replace("<transmission", &(joint + "<transmission"))
    };
    let replace = |from: &str, to: &str| {
        assert!(PENDULUM.contains(from), "{from}");
        PENDULUM.replace(from, to)
    };
    let cases = [
        // Masses and shapes.
        (replace(r#"value="2""#, r#"value="-2""#), r#"link "rod": line 6: the mass of -2 kg is negative"#),
        (
            replace(r#"value="2""#, r#"value="NaN""#),
            r#"expected a number within ±1e9 in <mass>, found "NaN""#,
        ),
        (replace(r#"value="2""#, r#"value="1e300""#), "found \"1e300\""),
        (replace(r#" value="2""#, ""), r#"<mass> has no attribute "value""#),
        (replace(r#"izz="0.01""#, r#"izz="0.9""#), "belong to no rigid body"),
        (replace(r#"izz="0.01""#, r#"izz="-0.01""#), "belong to no rigid body"),
        (replace(r#"ixy="0""#, r#"ixy="0.5""#), "belong to no rigid body"),
        (replace(r#"length="1""#, r#"length="0""#), "the length of 0 m of a <cylinder> is not positive"),
        (
            replace(r#"<cylinder radius="0.05" length="1"/>"#, r#"<mesh filename="a.stl"/>"#),
            "instead of \"a.stl\"",
        ),
        (replace(r#"<cylinder radius="0.05" length="1"/>"#, "<cone/>"), "<cone> is not a shape"),
        (replace(r#"<cylinder radius="0.05" length="1"/>"#, ""), "must hold exactly one shape"),
        (replace("<collision>", "<collision><origin/>"), "more than one <origin>"),
        // Joints.
        (replace(r#"xyz="2 0 0""#, r#"xyz="0 0 0""#), r#"joint "hinge": line 12: the axis has no length"#),
        (
            replace(r#"xyz="2 0 0""#, r#"xyz="2 0""#),
            r#"expected 3 numbers within ±1e9 in <axis>, found "2 0""#,
        ),
        (replace(r#"xyz="2 0 0""#, r#"xyz="2 0 0 0""#), "expected 3 numbers in <axis>"),
        (replace(r#"xyz="2 0 0""#, r#"xyz="2,0,0""#), "found \"2,0,0\""),
        (replace("revolute", "prismatic"), "joints of type \"prismatic\" are not supported"),
        (replace("<axis", r#"<mimic joint="other"/><axis"#), "mimic joints are not supported"),
        (replace(r#" effort="10""#, ""), r#"<limit> has no attribute "effort""#),
        (replace(r#"<limit lower="-1" upper="1" effort="10" velocity="5"/>"#, ""), "needs <limit>"),
        (replace(r#"lower="-1""#, r#"lower="2""#), "limits 2 to 1 rad"),
        (replace(r#"<child link="rod"/>"#, ""), "<child> is missing"),
        // The tree.
        (
            replace(r#"parent link="base""#, r#"parent link="bass""#),
            "names the link \"bass\", which does not exist",
        ),
        (replace(r#"parent link="base""#, r#"parent link="rod""#), "link \"rod\" is in or below a cycle"),
        (second_hinge("rod", "base"), "link \"base\" is in or below a cycle"),
        (replace(rod, r#"<link name="stray"/><link name="rod">"#), "the links \"base\" and \"stray\" both"),
        (second_hinge("base", "rod"), "is the child of more than one joint"),
        (replace(rod, r#"<link name="base">"#), "the name \"base\" is used twice"),
        (replace(rod, "<link>"), "it has no name"),
        ("<robot/>".to_owned(), "there are no links"),
        // The text.
        (replace("<robot", "<!DOCTYPE x><robot"), "line 2: a document type declaration"),
        (replace("<transmission", "<xacro:arm/><transmission"), "expand the file with xacro first"),
        (replace("pendulum\">", "&boom;\">"), "line 2: "),
        (replace("</robot>", ""), "line 14: the text ends inside an element"),
        (replace("</robot>", "</robot><robot/>"), "more than one outermost element"),
        ("<a>".repeat(50_000), "nested more than 32 deep"),
        (format!("<robot>{}</robot>", "<a/>".repeat(200_000)), "more than 200000 elements"),
        (" ".repeat((16 << 20) + 1), "more than the 16777216 accepted"),
        ("<html/>".to_owned(), "the outermost element is <html>, expected <robot>"),
        ("not xml <".to_owned(), "line 1"),
        (String::new(), "there is no element"),
    ];
    for (text, expected) in cases {
        let error = parse_urdf(&text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error:?} should contain {expected:?}");
    }
}

#[test]
fn a_robot_of_very_many_links_is_read_in_no_time() {
    let mut text = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
    for index in 1..20_000 {
        let above = index - 1;
        let joint = format!("<parent link=\"l{above}\"/><child link=\"l{index}\"/>");
        text +=
            &["<link name=\"l", "\"/><joint type=\"continuous\" name=\"j", "\">"].join(&index.to_string());
        text += &joint;
        text += "</joint>";
    }
    let robot = parse_urdf(&(text + "</robot>")).unwrap();
    assert_eq!((robot.tree.num_angles(), robot.limits.len()), (19_999, 19_999));
}
