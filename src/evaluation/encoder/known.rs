//! Encoders that published numbers were made with, and what random sentence pairs score under them.

use super::super::bert_score::Baseline;

/// An encoder people report numbers with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownEncoder {
    /// Name on the Hugging Face hub.
    pub name: &'static str,
    /// What it is for.
    pub purpose: &'static str,
    /// Layer that BERTScore takes by default, where it is for that.
    pub layer: Option<usize>,
    /// P, R and F of random English sentence pairs at that layer.
    pub baseline: Option<[f64; 3]>,
    /// Rough download size, megabytes.
    pub megabytes: u32,
}

/// Encoders worth having: the defaults of BERTScore for English, and SimCSE.
///
/// Baselines are those that the package bert-score publishes for English (`rescale_baseline/en`).
pub const KNOWN_ENCODERS: &[KnownEncoder] = &[
    KnownEncoder {
        name: "FacebookAI/roberta-large",
        purpose: "BERTScore as the paper and the field report it",
        layer: Some(17),
        baseline: Some([0.83150584, 0.8314941, 0.83122575]),
        megabytes: 1422,
    },
    KnownEncoder {
        name: "princeton-nlp/sup-simcse-bert-base-uncased",
        purpose: "sentence cosine as the paper reports it, pooled by pooler",
        layer: None,
        baseline: None,
        megabytes: 438,
    },
];

/// P, R and F of a layer out of a table in the form of bert-score: a heading, then `LAYER,P,R,F` a line.
///
/// # Errors
/// One line that says what is missing or wrong.
pub fn parse_baseline(text: &str, layer: usize, name: &str) -> Result<Baseline, String> {
    let row = text
        .lines()
        .map(|line| line.split([',', '\t']).map(str::trim).collect::<Vec<_>>())
        .find(|cells| cells.first().and_then(|cell| cell.parse::<usize>().ok()) == Some(layer))
        .ok_or_else(|| format!("it has no line for layer {layer}"))?;
    let cells: Vec<f64> = row[1..].iter().filter_map(|cell| cell.parse().ok()).collect();
    let values: [f64; 3] = cells
        .try_into()
        .map_err(|_| format!("the line of layer {layer} does not hold three numbers after the layer"))?;
    if values.iter().all(|value| value.is_finite() && *value < 1.0) {
        Ok(Baseline { values, name: name.to_owned() })
    } else {
        Err(format!("a baseline of layer {layer} is not below 1"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_baseline_is_found_by_layer() {
        let table = "LAYER,P,R,F\n0,0.1,0.2,0.3\n1,0.4,0.5,0.6\n";
        assert_eq!(parse_baseline(table, 1, "b").unwrap().values, [0.4, 0.5, 0.6]);
        assert!(parse_baseline(table, 2, "b").unwrap_err().contains("layer 2"));
        assert!(parse_baseline("0,0.1,x,0.3", 0, "b").unwrap_err().contains("three numbers"));
        assert!(parse_baseline("0,0.1,1.0,0.3", 0, "b").unwrap_err().contains("below 1"));
    }
}
