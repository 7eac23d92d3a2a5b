"""FID, shrinkage, diversity, R-precision and dynamic time warping by the programs of the field.

    python tests/golden/make_motion_scores.py > tests/golden/motion_scores.json

Embeddings are sin((place + 1) * (seed + 0.5)) in single precision, row after row, so that the file holds results only.
Poses are sums of two sines. FID takes scipy.linalg.sqrtm, as the field does; shrinkage is scikit-learn's Ledoit-Wolf;
R-precision counts, as Guo et al. do, in pools of 32 drawn with numpy, here 20,000 of them.
"""

import json
import sys

import dtw
import numpy
import scipy
import scipy.linalg
import sklearn
import sklearn.covariance


def embeddings(seed, rows, columns, scale=1.0):
    place = numpy.arange(1, rows * columns + 1, dtype=numpy.float64)
    return (numpy.sin(place * (seed + 0.5)) * scale).astype(numpy.float32).astype(numpy.float64).reshape(rows, columns)


def frechet(a, b, covariance):
    root = scipy.linalg.sqrtm(covariance(a) @ covariance(b))
    distance = a.mean(0) - b.mean(0)
    return float(distance @ distance + numpy.trace(covariance(a) + covariance(b) - 2 * root.real))


def sample(x):
    return numpy.cov(x, rowvar=False)


def shrunk(x):
    return sklearn.covariance.ledoit_wolf(x)[0]


def diversity(x):
    distances = numpy.linalg.norm(x[:, None] - x[None], axis=-1)
    return float(distances[numpy.triu_indices(len(x), 1)].mean())


def r_precision(queries, candidates, top, pools=20_000):
    draw = numpy.random.default_rng(0)
    distances = numpy.linalg.norm(queries[:, None] - candidates[None], axis=-1)
    hits = []
    for _ in range(pools):
        pool = draw.choice(len(queries), 32, replace=False)
        inner = distances[numpy.ix_(pool, pool)]
        hits.append(((inner < numpy.diag(inner)[:, None]).sum(1) < top).mean())
    return float(numpy.mean(hits))


def swing(frames, joints, late, seed):
    time = numpy.arange(frames)[:, None, None] / 10 - late
    place = numpy.arange(1, joints * 3 + 1).reshape(1, joints, 3)
    return 0.2 * numpy.sin(time * (0.7 + 0.1 * seed) + place) + 0.1 * numpy.sin(time * 2.3 + place * seed)


def warped(a, b):
    cost = numpy.linalg.norm(a[:, None] - b[None], axis=-1).mean(-1)
    found = dtw.dtw(cost, step_pattern=dtw.symmetric1)
    return {"sum": float(found.distance), "cells": len(found.index1), "mean_mm": 1000 * float(found.distance) / len(found.index1)}


many, other = embeddings(1, 60, 8), embeddings(2, 60, 8, 1.5) + 0.25
few, few_other = embeddings(3, 12, 16), embeddings(4, 12, 16, 0.5)
near = many + 0.6 * embeddings(5, 60, 8)
json.dump(
    {
        "made_by": "python tests/golden/make_motion_scores.py",
        "versions": {
            "python": sys.version.split()[0],
            "numpy": numpy.__version__,
            "scipy": scipy.__version__,
            "scikit-learn": sklearn.__version__,
            "dtw-python": dtw.__version__,
        },
        "fid_sample": frechet(many, other, sample),
        "fid_ledoit_wolf": frechet(few, few_other, shrunk),
        "diversity": diversity(many),
        "r_precision": [r_precision(many, near, top) for top in (1, 2, 3)],
        "warped": [
            warped(swing(50, 3, 0.6, 1), swing(70, 3, 0.0, 1)),
            warped(swing(40, 3, 0.0, 1), swing(40, 3, 0.0, 2)),
        ],
    },
    sys.stdout,
    indent=1,
)
print()
