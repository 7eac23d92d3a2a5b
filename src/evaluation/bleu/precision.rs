//! From summed counts to a score, by the rules of sacrebleu and of NLTK.

use super::super::ngrams::MAX_ORDER;
use super::Smoothing;

/// BLEU up to `order` from `[hypothesis length, reference length, 4 matches, 4 totals]`, in 0..1.
pub(super) fn score(total: &[f64], order: usize, smoothing: Smoothing, effective_order: bool) -> f64 {
    let (length, reference_length) = (total[0], total[1]);
    let matches = &total[2..2 + order];
    let totals = &total[2 + MAX_ORDER..2 + MAX_ORDER + order];
    let brevity = if length >= reference_length {
        1.0
    } else if length > 0.0 {
        (1.0 - reference_length / length).exp()
    } else {
        0.0
    };
    match smoothing {
        Smoothing::NltkNone | Smoothing::NltkEpsilon(_) | Smoothing::NltkLength(_) => {
            brevity * nltk(matches, totals, length, smoothing)
        }
        _ => brevity * sacrebleu(matches, totals, smoothing, effective_order),
    }
}

/// Geometric mean of the precisions by NLTK's rules.
fn nltk(matches: &[f64], totals: &[f64], length: f64, smoothing: Smoothing) -> f64 {
    if matches[0] == 0.0 {
        return 0.0;
    }
    let mut num_empty = 0;
    let mut log_sum = 0.0;
    for (&matched, &total) in matches.iter().zip(totals) {
        let precision = match smoothing {
            _ if matched > 0.0 => matched / total,
            Smoothing::NltkEpsilon(epsilon) => epsilon / total,
            Smoothing::NltkLength(k) if length > 1.0 => {
                num_empty += 1;
                length.ln() / (f64::from(num_empty).exp2() * k) / total
            }
            // A single word has no longer n-grams, and this method leaves them out.
            Smoothing::NltkLength(_) => continue,
            _ => f64::MIN_POSITIVE,
        };
        log_sum += precision.ln();
    }
    (log_sum / matches.len() as f64).exp()
}

/// Geometric mean of the precisions by sacrebleu's rules.
fn sacrebleu(matches: &[f64], totals: &[f64], smoothing: Smoothing, effective_order: bool) -> f64 {
    if matches.iter().all(|&count| count == 0.0) {
        return 0.0;
    }
    let mut num_orders = matches.len();
    let mut halving = 1.0;
    let mut log_sum = 0.0;
    for (index, (&matched, &total)) in matches.iter().zip(totals).enumerate() {
        let extra = match smoothing {
            Smoothing::AddK(k) if index > 0 => k,
            _ => 0.0,
        };
        let (matched, total) = (matched + extra, total + extra);
        if total == 0.0 {
            // No hypothesis is this long. Unless these orders are left out, they make the score zero.
            if !effective_order {
                return 0.0;
            }
            break;
        }
        if effective_order {
            num_orders = index + 1;
        }
        let counted = match smoothing {
            _ if matched > 0.0 => matched,
            Smoothing::Exp => {
                halving *= 0.5;
                halving
            }
            Smoothing::Floor(value) => value,
            _ => return 0.0,
        };
        log_sum += (counted / total).ln();
    }
    (log_sum / num_orders as f64).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five words against six: 4, 2, 0, 0 of 5, 4, 3, 2 n-grams match.
    const COUNTS: [f64; 10] = [5.0, 6.0, 4.0, 2.0, 0.0, 0.0, 5.0, 4.0, 3.0, 2.0];

    fn bleu4(smoothing: Smoothing) -> f64 {
        score(&COUNTS, 4, smoothing, false)
    }

    #[test]
    fn smoothing_by_hand() {
        let brevity = (-0.2_f64).exp();
        let product = 4.0 / 5.0 * (2.0 / 4.0);
        let expected = |third: f64, fourth: f64| brevity * (product * third * fourth).powf(0.25);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(bleu4(Smoothing::Exp), expected(0.5 / 3.0, 0.25 / 2.0));
        close(bleu4(Smoothing::Floor(0.1)), expected(0.1 / 3.0, 0.1 / 2.0));
        close(bleu4(Smoothing::NltkEpsilon(0.1)), expected(0.1 / 3.0, 0.1 / 2.0));
        let ln = 5.0_f64.ln() / 5.0;
        close(bleu4(Smoothing::NltkLength(5.0)), expected(0.5 * ln / 3.0, 0.25 * ln / 2.0));
        close(bleu4(Smoothing::AddK(1.0)), {
            brevity * (4.0 / 5.0 * (3.0 / 5.0) * (1.0 / 4.0) * (1.0 / 3.0_f64)).powf(0.25)
        });
        assert_eq!(bleu4(Smoothing::None), 0.0);
        let nearly = bleu4(Smoothing::NltkNone);
        assert!(nearly > 0.0 && nearly < 1e-100);
    }

    #[test]
    fn orders_longer_than_the_sentence_are_left_out_when_asked() {
        let two_words = [2.0, 2.0, 2.0, 1.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0];
        assert_eq!(score(&two_words, 4, Smoothing::Exp, true), 1.0);
        assert_eq!(score(&two_words, 4, Smoothing::Exp, false), 0.0);
    }
}
