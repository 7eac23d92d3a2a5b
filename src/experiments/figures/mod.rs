//! The paper's figures as SVG.
//!
//! Only SVG: it is text, opens in every browser, and a renderer for bitmaps would cost more to build than everything else
//! here.

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
