"""tiny_roberta/, tiny_bert/ and tiny_encoders.json: two small randomly initialised encoders and what they give.

Vocabularies are trained on the sentences of pairs.jsonl. The weights are drawn large, so that layers matter. The values
come from transformers and bert-score, one sentence at a time, without padding.
"""

import json
import os
import shutil
import sys
import warnings
from importlib.metadata import version

os.environ["HF_HUB_OFFLINE"] = "1"
os.environ["CUDA_VISIBLE_DEVICES"] = ""
import bert_score
import torch
import transformers
from tokenizers import Tokenizer, decoders, models, normalizers, pre_tokenizers, processors, trainers

warnings.filterwarnings("ignore")
transformers.logging.set_verbosity_error()
torch.set_num_threads(1)
HERE = os.path.dirname(os.path.abspath(__file__))
SHAPE = dict(hidden_size=24, num_hidden_layers=3, num_attention_heads=3, intermediate_size=48,
             hidden_dropout_prob=0.0, attention_probs_dropout_prob=0.0, initializer_range=0.35)


def bpe(sentences, folder):
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    special = ["<s>", "<pad>", "</s>", "<unk>", "<mask>"]
    trainer = trainers.BpeTrainer(vocab_size=480, special_tokens=special, show_progress=False,
                                  initial_alphabet=pre_tokenizers.ByteLevel.alphabet())
    tokenizer.train_from_iterator(sentences, trainer)
    tokenizer.post_processor = processors.RobertaProcessing(("</s>", 2), ("<s>", 0), True, False)
    tokenizer.model.save(folder)
    tokenizer.save(os.path.join(folder, "tokenizer.json"))
    return tokenizer.get_vocab_size()


def wordpiece(sentences, folder):
    tokenizer = Tokenizer(models.WordPiece(unk_token="[UNK]"))
    tokenizer.normalizer = normalizers.BertNormalizer(lowercase=True)
    tokenizer.pre_tokenizer = pre_tokenizers.BertPreTokenizer()
    special = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]"]
    trainer = trainers.WordPieceTrainer(vocab_size=400, special_tokens=special, show_progress=False)
    # Only half of the sentences, so that the others have words in pieces and unknown symbols.
    tokenizer.train_from_iterator(sentences[::2], trainer)
    tokenizer.model.save(folder)
    return tokenizer.get_vocab_size()


def build(kind, sentences):
    folder = os.path.join(HERE, f"tiny_{kind}")
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    torch.manual_seed(7)
    if kind == "roberta":
        size = bpe(sentences, folder)
        config = transformers.RobertaConfig(vocab_size=size, max_position_embeddings=66, type_vocab_size=1,
                                            pad_token_id=1, bos_token_id=0, eos_token_id=2, layer_norm_eps=1e-5, **SHAPE)
        model = transformers.RobertaModel(config)
    else:
        size = wordpiece(sentences, folder)
        config = transformers.BertConfig(vocab_size=size, max_position_embeddings=64, **SHAPE)
        model = transformers.BertModel(config)
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            # transformers starts these at one and zero, where a mistake would not show.
            if "LayerNorm" in name or name.endswith("bias"):
                parameter.add_(torch.randn_like(parameter) * 0.1)
    model.save_pretrained(folder)
    with open(os.path.join(folder, "tokenizer_config.json"), "w") as file:
        name = "RobertaTokenizer" if kind == "roberta" else "BertTokenizer"
        json.dump({"tokenizer_class": name, "model_max_length": 64, "do_lower_case": True}, file, indent=1)
        file.write("\n")
    return folder


def triples(values):
    return [[float(x) for x in row] for row in zip(*values)]


def main():
    with open(os.path.join(HERE, "pairs.jsonl"), encoding="utf-8") as file:
        pairs = [json.loads(line) for line in file]
    sentences = sorted({s for p in pairs for s in [p["hypothesis"], *p["references"]]})
    hypotheses = [p["hypothesis"] for p in pairs]
    references = [p["references"] for p in pairs]
    flat = [(p["hypothesis"], r) for p in pairs for r in p["references"]]
    baseline = os.path.join(HERE, "tiny_baseline.tsv")
    with open(baseline, "w") as file:
        file.write("LAYER,P,R,F\n0,0.31,0.32,0.33\n1,0.41,0.42,0.43\n2,0.51,0.52,0.53\n3,0.61,0.62,0.63\n")
    packages = ("torch", "transformers", "tokenizers", "bert-score")
    out = {"command": "python make_tiny_encoders.py", "versions": {name: version(name) for name in packages}}
    for kind in ("roberta", "bert"):
        folder = build(kind, sentences)
        tokenizer = transformers.AutoTokenizer.from_pretrained(folder)
        model = transformers.AutoModel.from_pretrained(folder, attn_implementation="eager").eval()
        result = {"tokens": {}, "bert_score": [], "probe": {}}
        for sentence in [p["hypothesis"] for p in pairs[::8]] + ["  leading and trailing  ", "naïve ☃ 人"]:
            result["tokens"][sentence] = bert_score.utils.sent_encode(tokenizer, sentence)
        for layer, idf, rescale in ((3, False, False), (2, True, False), (2, False, True), (1, True, True)):
            scorer = bert_score.BERTScorer(model_type=folder, num_layers=layer, idf=idf, lang="en", device="cpu",
                                           idf_sents=[r for _, r in flat] if idf else None, batch_size=1, nthreads=1,
                                           rescale_with_baseline=rescale, baseline_path=baseline)
            singles = torch.stack(scorer.score([h for h, _ in flat], [r for _, r in flat], batch_size=1))
            values, start = [], 0
            for group in references:
                # What the package does with several references: the best of each value.
                values.append(singles[:, start : start + len(group)].max(dim=1).values.tolist())
                start += len(group)
            result["bert_score"].append({"layer": layer, "idf": idf, "rescaled": rescale, "segments": values})
        probe = "a person walks forward slowly."
        with torch.no_grad():
            output = model(**tokenizer(probe, return_tensors="pt"), output_hidden_states=True)
        result["probe"] = {"text": probe, "hidden_states": [h[0].tolist() for h in output.hidden_states],
                           "pooler": output.pooler_output[0].tolist()}
        out[kind] = result
    with open(os.path.join(HERE, "tiny_encoders.json"), "w", encoding="utf-8") as file:
        text = json.dumps(out, ensure_ascii=False, indent=0)
        file.write(text + "\n")
    print({k: [sum(s[2] for s in r["segments"]) / len(pairs) for r in out[k]["bert_score"]] for k in ("roberta", "bert")})


if __name__ == "__main__":
    sys.exit(main())
