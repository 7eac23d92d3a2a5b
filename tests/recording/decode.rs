//! The reading side of the messages, written apart from the writing side.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

pub struct Cdr<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> Cdr<'a> {
    pub fn new(message: &'a [u8]) -> Self {
        assert_eq!(message[..4], [0, 1, 0, 0], "plain CDR, little endian");
        Self { body: &message[4..], at: 0 }
    }

    fn take<const SIZE: usize>(&mut self) -> [u8; SIZE] {
        self.at = self.at.div_ceil(SIZE) * SIZE;
        self.at += SIZE;
        self.body[self.at - SIZE..self.at].try_into().unwrap()
    }

    pub fn u8(&mut self) -> u8 {
        self.take::<1>()[0]
    }

    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    pub fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    pub fn vector(&mut self) -> [f64; 3] {
        [self.f64(), self.f64(), self.f64()]
    }

    pub fn bytes(&mut self) -> &'a [u8] {
        let len = self.u32() as usize;
        self.at += len;
        &self.body[self.at - len..self.at]
    }

    pub fn string(&mut self) -> &'a str {
        std::str::from_utf8(self.bytes().strip_suffix(&[0]).unwrap()).unwrap()
    }

    /// Nanoseconds.
    pub fn stamp(&mut self) -> u64 {
        let secs = i32::from_le_bytes(self.take());
        secs as u64 * 1_000_000_000 + u64::from(self.u32())
    }

    pub fn f64s(&mut self) -> Vec<f64> {
        (0..self.u32()).map(|_| self.f64()).collect()
    }

    pub fn end(self) {
        assert_eq!(self.at, self.body.len(), "bytes are left over");
    }
}

pub struct Transform {
    pub stamp: u64,
    pub parent: String,
    pub child: String,
    pub parent_from_child: Isometry3<f64>,
}

pub fn transforms(message: &[u8]) -> Vec<Transform> {
    let mut cdr = Cdr::new(message);
    let transforms = (0..cdr.u32())
        .map(|_| {
            let stamp = cdr.stamp();
            let (parent, child) = (cdr.string().to_owned(), cdr.string().to_owned());
            let translation = Translation3::from(cdr.vector());
            let [i, j, k, w] = [cdr.f64(), cdr.f64(), cdr.f64(), cdr.f64()];
            assert!((i * i + j * j + k * k + w * w - 1.0).abs() < 1e-6);
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
            let parent_from_child = Isometry3::from_parts(translation, rotation);
            Transform { stamp, parent, child, parent_from_child }
        })
        .collect();
    cdr.end();
    transforms
}

pub struct JointState {
    pub stamp: u64,
    pub names: Vec<String>,
    pub positions: Vec<f64>,
    pub velocities: Vec<f64>,
    pub efforts: Vec<f64>,
}

pub fn joint_state(message: &[u8]) -> JointState {
    let mut cdr = Cdr::new(message);
    let stamp = cdr.stamp();
    assert_eq!(cdr.string(), "");
    let names = (0..cdr.u32()).map(|_| cdr.string().to_owned()).collect();
    let (positions, velocities, efforts) = (cdr.f64s(), cdr.f64s(), cdr.f64s());
    cdr.end();
    JointState { stamp, names, positions, velocities, efforts }
}

/// Points as x, y, z, force.
pub fn point_cloud(message: &[u8]) -> Vec<[f32; 4]> {
    let mut cdr = Cdr::new(message);
    cdr.stamp();
    assert_eq!(cdr.string(), "world");
    let (height, width) = (cdr.u32(), cdr.u32());
    let fields: Vec<_> =
        (0..cdr.u32()).map(|_| (cdr.string().to_owned(), cdr.u32(), cdr.u8(), cdr.u32())).collect();
    let expected = ["x", "y", "z", "force"].into_iter().zip(0..);
    assert_eq!(fields, expected.map(|(n, i)| (n.to_owned(), 4 * i, 7, 1)).collect::<Vec<_>>());
    assert_eq!(cdr.u8(), 0, "little endian");
    assert_eq!((height, cdr.u32(), cdr.u32()), (1, 16, 16 * width));
    let data = cdr.bytes();
    assert_eq!(cdr.u8(), 1, "dense");
    cdr.end();
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    data.chunks_exact(16)
        .map(|p| [number(&p[..4]), number(&p[4..8]), number(&p[8..12]), number(&p[12..])])
        .collect()
}

/// Frame, force, moment.
pub fn wrench(message: &[u8]) -> (String, [f64; 3], [f64; 3]) {
    let mut cdr = Cdr::new(message);
    cdr.stamp();
    let wrench = (cdr.string().to_owned(), cdr.vector(), cdr.vector());
    cdr.end();
    wrench
}

pub fn metrics(message: &[u8], count: usize) -> Vec<f64> {
    let mut cdr = Cdr::new(message);
    cdr.stamp();
    assert_eq!(cdr.string(), "world");
    let values = (0..count).map(|_| cdr.f64()).collect();
    cdr.end();
    values
}

pub fn text(message: &[u8]) -> String {
    let mut cdr = Cdr::new(message);
    let text = cdr.string().to_owned();
    cdr.end();
    text
}

/// Stamp, severity, text.
pub fn log(message: &[u8]) -> (u64, u8, String) {
    let mut cdr = Cdr::new(message);
    let (stamp, severity) = (cdr.stamp(), cdr.u8());
    cdr.string();
    let text = cdr.string().to_owned();
    // File, function and line.
    assert_eq!((cdr.string(), cdr.string(), cdr.u32()), ("", "", 0));
    cdr.end();
    (stamp, severity, text)
}
