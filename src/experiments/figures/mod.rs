//! The paper's figures as SVG.
//!
//! Only SVG: it is text and opens in every browser. A renderer for bitmaps (resvg 0.45) would bring thirty more crates and 41
//! seconds of processor time to an unoptimised build, and its letters would depend on the fonts of the machine.

mod curves;
mod efficiency;
mod scatter;
mod tsne;
mod verbs;

pub use curves::{CurveRow, Frames, joint_curves};
pub use efficiency::efficiency;
pub use scatter::{ScatterPoint, scatter};
pub use tsne::tsne;
pub use verbs::verb_label;
