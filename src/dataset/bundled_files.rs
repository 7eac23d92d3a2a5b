//! The motions built into the program: name and content of each file in `assets/suite`.

/// Name and content of a file of the suite.
macro_rules! suite_file {
    ($name:literal) => {
        ($name, include_bytes!(concat!("../../assets/suite/", $name)))
    };
}

/// Files in the layout of KIT-ML, sorted by name.
pub(super) const FILES: &[(&str, &[u8])] = &[
    suite_file!("90001_annotations.json"),
    suite_file!("90001_mmm.xml"),
    suite_file!("90002_annotations.json"),
    suite_file!("90002_mmm.xml"),
    suite_file!("90003_annotations.json"),
    suite_file!("90003_mmm.xml"),
    suite_file!("90004_annotations.json"),
    suite_file!("90004_mmm.xml"),
    suite_file!("90005_annotations.json"),
    suite_file!("90005_mmm.xml"),
    suite_file!("90006_annotations.json"),
    suite_file!("90006_mmm.xml"),
    suite_file!("90007_annotations.json"),
    suite_file!("90007_mmm.xml"),
    suite_file!("90008_annotations.json"),
    suite_file!("90008_mmm.xml"),
    suite_file!("90009_annotations.json"),
    suite_file!("90009_mmm.xml"),
    suite_file!("90010_annotations.json"),
    suite_file!("90010_mmm.xml"),
    suite_file!("90011_annotations.json"),
    suite_file!("90011_mmm.xml"),
    suite_file!("90012_annotations.json"),
    suite_file!("90012_mmm.xml"),
    suite_file!("90901_annotations.json"),
    suite_file!("90901_mmm.xml"),
    suite_file!("90902_annotations.json"),
    suite_file!("90902_mmm.xml"),
    suite_file!("90903_annotations.json"),
    suite_file!("90903_mmm.xml"),
];
