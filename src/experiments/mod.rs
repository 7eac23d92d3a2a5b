//! The experiments of the paper: a grid of models, trained and scored side by side.
//!
//! In: a [`Grid`] of settings and a prepared set. Out: a folder with a trained model for every cell, the tables of the
//! paper with intervals, and figures. What one model is worth is [`score`]d on pairs it never saw, in both directions.
//!
//! ```text
//! OUT/grid.toml                 everything that decides the numbers; written first
//! OUT/cells/NAME/               run folder of one model, as `rprae train` makes it
//! OUT/tables.md, tables.json    Tables 2 to 7 beside the paper's
//! OUT/samples.jsonl             what every model said and did, without the reference captions
//! OUT/*.svg                     figures
//! ```

mod amounts;
mod baseline;
mod draw;
mod estimate;
mod evaluator;
mod grid;
pub mod paper;
mod poses;
mod run;
mod score;

pub use amounts::Amount;
pub use baseline::{MOMENTS, most_frequent_caption, nearest_in_pose_space};
pub use draw::{DrawError, draw};
pub use estimate::{Difference, Estimate, difference, estimate};
pub use evaluator::{Evaluator, EvaluatorError};
pub use grid::{Cell, Grid, GridError, Role};
pub use poses::{HEIGHT_M, humanoid, in_heading_frame};
pub use run::{CELLS, CellError, cell_folder, is_trained, load_cell, train_cell};
pub use score::{Described, Outcome, Performed, ScoreError, score};
