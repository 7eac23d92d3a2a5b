//! The experiments of the paper: a grid of models, trained and scored side by side.
//!
//! In: a [`Grid`] of settings and a prepared set. Out: a folder with a trained model for every cell, the tables of the
//! paper with intervals, and figures. What one model is worth is [`score`]d on pairs it never saw, in both directions.
//!
//! ```text
//! OUT/grid.toml                 everything that decides the numbers; written first
//! OUT/cells/NAME/               run folder of one model, as `rprae train` makes it
//! OUT/samples.jsonl             what every model said and did, without the reference captions
//! OUT/*.svg, captions.md        figures
//! OUT/tables.md                 Tables 2 to 7 beside the paper's
//! OUT/scores.json               the same and more for programs, with the manifest; written last
//! ```

mod amounts;
mod baseline;
mod collect;
mod differences;
mod draw;
mod estimate;
mod evaluator;
pub mod figures;
mod grid;
mod held_out;
pub mod paper;
mod pictures;
mod poses;
mod records;
mod run;
mod score;
mod tables;

pub use amounts::Amount;
pub use baseline::{MOMENTS, most_frequent_caption, nearest_in_pose_space};
pub use collect::{CollectError, Row, SeedScores, collect};
pub use differences::{Against, differences, relative};
pub use draw::{DrawError, Drawn, draw};
pub use estimate::{Difference, Estimate, difference, estimate};
pub use evaluator::{Evaluator, EvaluatorError};
pub use grid::{Cell, Grid, GridError, Role};
pub use held_out::HeldOut;
pub use pictures::{captions, pictures};
pub use poses::{HEIGHT_M, humanoid, in_heading_frame};
pub use records::{GridRecord, Judge, REFERENCES, RowRecord, ScoreRecord, record, samples};
pub use run::{CELLS, CellError, cell_folder, check_cell, is_trained, load_cell, train_cell};
pub use score::{Described, Outcome, Performed, ScoreError, score};
pub use tables::tables;
