"""The lxml side of `cargo bench --bench ingest`: MMM XML files into numpy arrays on one core.

Reads the files named on the command line into memory, prints one line about itself, then parses all of them once for
each line on standard input and answers with the CPU seconds taken and the sum of all numbers.

Of several ways to get at the numbers this is the fastest we found: one tree per file, and one call of numpy's own text
parser per quantity instead of one per number or frame.
"""

import platform
import sys
import time

import lxml.etree as etree
import numpy as np


def parse(document):
    """Time stamps [frame], root position [frame, 3] in mm, root rotation [frame, 3], joint angles [frame, 44]."""
    frames = etree.fromstring(document).find("Motion/MotionFrames")
    arrays = []
    for tag, width in (("Timestep", 1), ("RootPosition", 3), ("RootRotation", 3), ("JointPosition", 44)):
        text = " ".join([element.text for element in frames.iter(tag)])
        arrays.append(np.fromstring(text, sep=" ").reshape(-1, width))
    return arrays


def main():
    documents = []
    for path in sys.argv[1:]:
        with open(path, "rb") as file:
            documents.append(file.read())
    version = ".".join(map(str, etree.LXML_VERSION[:3]))
    print(f"lxml {version}, numpy {np.__version__}, Python {platform.python_version()}", flush=True)
    for _ in sys.stdin:
        start = time.process_time()
        parsed = [parse(document) for document in documents]
        secs = time.process_time() - start
        total = sum(float(array.sum()) for arrays in parsed for array in arrays[1:])
        print(secs, total, flush=True)


if __name__ == "__main__":
    main()
