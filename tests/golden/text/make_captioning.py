"""captioning.json from pairs.jsonl: ROUGE-L of rouge-score and pycocoevalcap, CIDEr-D of pycocoevalcap, plain CIDEr.

The plain CIDEr of its paper has no published package; it is computed here from its equations with dictionaries, as a
second opinion. Words are those of "lower_words" in make_bleu.py, joined by spaces, in place of the Java tokeniser.
"""

import json
import math
import os
import re
from collections import Counter
from importlib.metadata import version

from pycocoevalcap.cider.cider import Cider
from pycocoevalcap.rouge.rouge import Rouge
from rouge_score.rouge_scorer import RougeScorer

HERE = os.path.dirname(os.path.abspath(__file__))


def words(sentence):
    return re.findall(r"\w+(?:[-']\w+)*|[^\w\s]", sentence.lower())


def vectors(tokens, documents, frequency):
    """TF-IDF vector of every length of n-gram."""
    result = []
    for n in range(1, 5):
        counts = Counter(tuple(tokens[i : i + n]) for i in range(len(tokens) - n + 1))
        result.append({g: c * math.log(documents / max(1, frequency[g])) for g, c in counts.items()})
    return result


def cosine(a, b):
    dot = sum(a[g] * b.get(g, 0.0) for g in a)
    norm = math.sqrt(sum(x * x for x in a.values()) * sum(x * x for x in b.values()))
    return dot / norm if norm else 0.0


def plain_cider(hypotheses, references):
    frequency = Counter()
    for group in references:
        grams = {tuple(r[i : i + n]) for r in group for n in range(1, 5) for i in range(len(r) - n + 1)}
        frequency.update(grams)
    scores = []
    for hypothesis, group in zip(hypotheses, references):
        ours = vectors(hypothesis, len(references), frequency)
        total = 0.0
        for reference in group:
            theirs = vectors(reference, len(references), frequency)
            total += sum(cosine(a, b) for a, b in zip(ours, theirs)) / 4
        scores.append(10 * total / len(group))
    return scores


def main():
    with open(os.path.join(HERE, "pairs.jsonl"), encoding="utf-8") as file:
        pairs = [json.loads(line) for line in file]
    hypotheses = [words(p["hypothesis"]) for p in pairs]
    references = [[words(r) for r in p["references"]] for p in pairs]
    results = {p["id"]: [" ".join(h)] for p, h in zip(pairs, hypotheses)}
    truths = {p["id"]: [" ".join(r) for r in group] for p, group in zip(pairs, references)}
    rouge_mean, rouge = Rouge().compute_score(truths, results)
    cider_mean, cider = Cider().compute_score(truths, results)
    scorer = RougeScorer(["rougeL"], use_stemmer=False)
    package = [scorer.score_multi(p["references"], p["hypothesis"])["rougeL"].fmeasure for p in pairs]
    plain = plain_cider(hypotheses, references)
    out = {
        "command": "python make_captioning.py",
        "versions": {name: version(name) for name in ("rouge-score", "pycocoevalcap", "numpy")},
        "rouge_l_captioning": {"corpus": float(rouge_mean), "segments": [float(x) for x in rouge]},
        "rouge_l_rouge_score": {"corpus": sum(package) / len(package), "segments": package},
        "cider_d": {"corpus": float(cider_mean), "segments": [float(x) for x in cider]},
        "cider": {"corpus": sum(plain) / len(plain), "segments": plain},
    }
    with open(os.path.join(HERE, "captioning.json"), "w", encoding="utf-8") as file:
        json.dump(out, file, indent=0)
        file.write("\n")
    print({key: value["corpus"] for key, value in out.items() if isinstance(value, dict) and "corpus" in value})


if __name__ == "__main__":
    main()
