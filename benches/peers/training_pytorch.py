"""A training iteration of the action autoencoder in PyTorch, timed beside ours by benches/recurrent.rs.

    python benches/peers/training_pytorch.py --threads 2 [--gpu] < requests

One JSON request a line on stdin, one JSON answer a line on stdout, so that two programs can take turns:

    {"variant": "padded", "lengths": [68, 56, ...], "width": 285}  ->  {"secs": 25.1, "cpu_secs": 49.8, "loss": 0.33, "peak_mib": 4100}
    {"variant": "matmul", "size": 2000}                            ->  {"gflops": 137.0}

One iteration is forward, mean squared error over valid frames, backward and a step of Adam. Layers: LSTM 50 -> 500, linear
500 -> 500, three LSTM layers 50 -> 500 -> 500 -> 500, linear 500 -> 50 with tanh. The decoder hears the frame before the one it
is to say (teacher forcing), which PyTorch's fused layers need: the same number of operations as a closed loop. Variants:

- padded: all sequences at the width of the longest, loss masked.
- packed: pack_padded_sequence.
- bucketed: the batch sorted by length and cut into eight buckets of equal size, each padded to its own longest; gradients added.
- loop: nn.LSTMCell, step by step, on its own output, all sequences at the width of the longest.
"""

import argparse
import json
import resource
import sys
import time

import torch
from torch.nn.utils.rnn import pack_padded_sequence, pad_packed_sequence

BUCKETS = 8


class Actions(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.encoder = torch.nn.LSTM(50, 500, batch_first=True)
        self.latent = torch.nn.Linear(500, 500)
        self.decoder = torch.nn.LSTM(50, 500, 3, batch_first=True)
        self.output = torch.nn.Linear(500, 50)

    def initial(self, last):
        hidden = torch.cat([self.latent(last)[None], torch.zeros(2, last.shape[0], 500, device=last.device)])
        return hidden, torch.zeros_like(hidden)

    def padded(self, x, lengths):
        states, _ = self.encoder(x)
        last = states[torch.arange(len(lengths), device=x.device), lengths - 1]
        said, _ = self.decoder(x, self.initial(last))
        return torch.tanh(self.output(said))

    def packed(self, x, lengths):
        frames = pack_padded_sequence(x, lengths.cpu(), True, False)
        _, (last, _) = self.encoder(frames)
        said, _ = self.decoder(frames, self.initial(last[-1]))
        said, _ = pad_packed_sequence(said, True, total_length=x.shape[1])
        return torch.tanh(self.output(said))

    def loop(self, x, lengths):
        states, _ = self.encoder(x)
        last = states[torch.arange(len(lengths), device=x.device), lengths - 1]
        hidden, cell = self.initial(last)
        hidden, cell = list(hidden), list(cell)
        weights = [[getattr(self.decoder, f"{name}_l{layer}") for name in
                    ("weight_ih", "weight_hh", "bias_ih", "bias_hh")] for layer in range(3)]
        heard, said = x[:, 0], []
        for _ in range(x.shape[1]):
            below = heard
            for layer in range(3):
                hidden[layer], cell[layer] = torch.lstm_cell(below, (hidden[layer], cell[layer]), *weights[layer])
                below = hidden[layer]
            heard = torch.tanh(self.output(below))
            said.append(heard)
        return torch.stack(said, 1)


def mask(lengths, width):
    return (torch.arange(width, device=lengths.device)[None] < lengths[:, None]).float()[..., None]


def iterate(model, optimiser, variant, x, lengths):
    frames = lengths.sum() * 50
    optimiser.zero_grad()
    if variant == "bucketed":
        total = 0.0
        order = lengths.argsort(descending=True)
        for rows in order.chunk(BUCKETS):
            own = lengths[rows]
            part = x[rows, : own.max()]
            loss = (((model.padded(part, own) - part) ** 2) * mask(own, part.shape[1])).sum() / frames
            loss.backward()
            total += loss.item()
    else:
        loss = (((getattr(model, variant)(x, lengths) - x) ** 2) * mask(lengths, x.shape[1])).sum() / frames
        loss.backward()
        total = loss.item()
    optimiser.step()
    return total


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--gpu", action="store_true", help="run on CUDA if there is any")
    arguments = arguments.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.manual_seed(0)
    on_gpu = arguments.gpu and torch.cuda.is_available()
    device = torch.device("cuda" if on_gpu else "cpu")
    # As exact as on the processor and as ours.
    torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = False
    wait = torch.cuda.synchronize if on_gpu else lambda: None
    model = Actions().to(device)
    optimiser = torch.optim.Adam(model.parameters(), 1e-3, fused=True)
    print(json.dumps({"ready": True, "version": torch.__version__,
                      "device": torch.cuda.get_device_name() if on_gpu else "the processor"}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        if request["variant"] == "matmul":
            size = request["size"]
            a, b = torch.rand(size, size, device=device), torch.rand(size, size, device=device)
            torch.mm(a, b)
            wait()
            start = time.perf_counter()
            for _ in range(3):
                torch.mm(a, b)
            wait()
            answer = {"gflops": 6 * size**3 / (time.perf_counter() - start) / 1e9}
        else:
            lengths = torch.tensor(request["lengths"], device=device)
            x = torch.rand(len(lengths), request["width"], 50, device=device) * 2 - 1
            x = x * mask(lengths, request["width"])
            wait()
            start, cpu = time.perf_counter(), time.process_time()
            loss = iterate(model, optimiser, request["variant"], x, lengths)
            wait()
            answer = {"secs": time.perf_counter() - start, "cpu_secs": time.process_time() - cpu, "loss": loss}
            answer["peak_mib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
