//! The paper's figures as SVG.
//!
//! SVG is text and opens in every browser; with the feature `png`, `report` makes bitmaps of it.

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
