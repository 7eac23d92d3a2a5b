//! How sentences are looked for, on the command line.

use clap::ValueEnum;

use crate::translation;

/// Sentences followed side by side.
const DEFAULT_BEAM: u16 = 5;
/// The same, or sentences drawn, where they are compared with each other.
const DEFAULT_CONSENSUS_BEAM: u16 = 32;

/// Which of the sentences found is the best.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Choose {
    /// The most probable of the beam
    Probable,
    /// The one most similar to all of the beam, weighted by probability (minimum Bayes risk)
    Consensus,
    /// The one most similar to all of as many sentences drawn from the model
    SampledConsensus,
}

impl Choose {
    /// Sentences followed side by side, or drawn, unless told otherwise.
    pub fn default_beam(self) -> u16 {
        match self {
            Self::Probable => DEFAULT_BEAM,
            Self::Consensus | Self::SampledConsensus => DEFAULT_CONSENSUS_BEAM,
        }
    }
}

impl From<Choose> for translation::Choose {
    fn from(choose: Choose) -> Self {
        match choose {
            Choose::Probable => Self::Probable,
            Choose::Consensus => Self::Consensus,
            Choose::SampledConsensus => Self::SampledConsensus,
        }
    }
}
