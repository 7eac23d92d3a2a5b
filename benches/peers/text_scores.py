"""The sacrebleu and bert_score side of `cargo bench --bench text_scores`.

Arguments: a JSONL file of pairs, the number of threads, and the folder of an encoder with a layer, or nothing for BLEU
alone. Prints one line about itself, then for each line on standard input, `bleu` or `bert`, the seconds taken and the
score. Both start from strings and end with the score of the corpus; loading the encoder is not timed.
"""

import json
import logging
import os
import sys
import time
import warnings

os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["CUDA_VISIBLE_DEVICES"] = ""
THREADS = sys.argv[2]
os.environ["OMP_NUM_THREADS"] = THREADS
os.environ["RAYON_NUM_THREADS"] = THREADS

import sacrebleu
from sacrebleu.metrics import BLEU


def bleu(hypotheses, streams):
    # The tokeniser remembers sentences; a fresh corpus has none of them in memory.
    metric = BLEU()
    for tokenizer in (metric.tokenizer, metric.tokenizer._post_tokenizer):
        type(tokenizer).__call__.cache_clear()
    return metric.corpus_score(hypotheses, streams).score


def main():
    warnings.filterwarnings("ignore")
    logging.disable(logging.WARNING)
    with open(sys.argv[1], encoding="utf-8") as file:
        pairs = [json.loads(line) for line in file]
    hypotheses = [p["hypothesis"] for p in pairs]
    references = [p["references"] for p in pairs]
    most = max(map(len, references))
    streams = [[r[k] if k < len(r) else None for r in references] for k in range(most)]
    about = f"sacrebleu {sacrebleu.__version__}"
    scorer = None
    if len(sys.argv) > 3:
        import bert_score
        import torch
        import transformers

        torch.set_num_threads(int(THREADS))
        scorer = bert_score.BERTScorer(model_type=sys.argv[3], num_layers=int(sys.argv[4]), device="cpu", nthreads=0)
        about += f", bert_score {bert_score.__version__}, torch {torch.__version__}, transformers {transformers.__version__}"
    print(about, flush=True)
    for line in sys.stdin:
        start = time.perf_counter()
        if line.strip() == "bleu":
            score = bleu(hypotheses, streams)
        else:
            score = scorer.score(hypotheses, references, batch_size=64)[2].mean().item()
        print(time.perf_counter() - start, score, flush=True)


if __name__ == "__main__":
    main()
