"""Values and gradients of recurrent layers and closed-loop decoders, computed by PyTorch in double precision.

    python tests/golden/make_recurrent.py > tests/golden/recurrent.json

Known inputs run through nn.LSTM over packed sequences, both directions; closed loops step by step through nn.LSTMCell, each
sequence for as many steps as its length. Every case's loss is the sum of all outputs (and last states) times weights.
Inputs come from sin(k * place) so that the file needs to hold results only.
"""

import json
import sys

import torch

torch.set_default_dtype(torch.float64)


def numbers(seed, *shape, scale=1.0):
    """sin((place + 1) * (seed + 0.5)) * scale, row after row."""
    count = 1
    for size in shape:
        count *= size
    place = torch.arange(1, count + 1, dtype=torch.float64)
    return (torch.sin(place * (seed + 0.5)) * scale).reshape(shape).requires_grad_()


def layer(seed, feature, hidden):
    """Weights as this project stores them: [feature, 4 hidden], [hidden, 4 hidden], [4 hidden], gates i, f, g, o."""
    return [
        numbers(seed, feature, 4 * hidden, scale=0.6),
        numbers(seed + 1, hidden, 4 * hidden, scale=0.6),
        numbers(seed + 2, 4 * hidden, scale=0.6),
    ]


def flat(tensor):
    return [float(number) for number in tensor.detach().reshape(-1)]


def gradients(loss, named):
    values = torch.autograd.grad(loss, list(named.values()), allow_unused=True)
    return {
        name: flat(torch.zeros_like(tensor) if value is None else value)
        for (name, tensor), value in zip(named.items(), values)
    }


def sequence(lengths, width, direction):
    batch, feature, hidden = len(lengths), 3, 4
    x = numbers(1, batch, width, feature)
    h, c = numbers(2, batch, hidden, scale=0.5), numbers(3, batch, hidden, scale=0.5)
    weights = layer(4, feature, hidden)
    bidirectional = direction == "backward"
    module = torch.nn.LSTM(feature, hidden, batch_first=True, bidirectional=bidirectional)
    suffix = "_l0_reverse" if bidirectional else "_l0"
    parameters = {name: value.detach() for name, value in module.named_parameters()}
    parameters |= {
        "weight_ih" + suffix: weights[0].T,
        "weight_hh" + suffix: weights[1].T,
        "bias_ih" + suffix: weights[2],
        "bias_hh" + suffix: torch.zeros(4 * hidden),
    }
    states = tuple(torch.stack([state] * (2 if bidirectional else 1)) for state in (h, c))
    packed = torch.nn.utils.rnn.pack_padded_sequence(x, torch.tensor(lengths), True, False)
    out, (last_h, last_c) = torch.func.functional_call(module, parameters, (packed, states))
    out, _ = torch.nn.utils.rnn.pad_packed_sequence(out, True, total_length=width)
    out, last_h, last_c = out[..., -hidden:], last_h[-1], last_c[-1]
    loss = (out * numbers(7, *out.shape)).sum()
    loss = loss + (last_h * numbers(8, *last_h.shape)).sum() + (last_c * numbers(9, *last_c.shape)).sum()
    named = {"input": x, "hidden": h, "cell": c, "input weights": weights[0], "recurrent weights": weights[1]}
    named["bias"] = weights[2]
    return {
        "kind": "sequence",
        "direction": direction,
        "lengths": lengths,
        "width": width,
        "feature": feature,
        "hidden": [hidden],
        "output": flat(out),
        "last hidden": flat(last_h),
        "last cell": flat(last_c),
        "gradients": gradients(loss, named),
    }


def closed_loop(lengths, hidden, words):
    batch, width, feature = len(lengths), max(lengths), 3
    outputs = 6 if words else feature
    first = numbers(1, batch, feature)
    projection, bias = numbers(2, hidden[-1], outputs), numbers(3, outputs, scale=0.3)
    named = {"first": first, "projection": projection, "projection bias": bias}
    if words:
        table = named["table"] = numbers(4, outputs, feature)
    cells, below = [], feature
    for index, units in enumerate(hidden):
        weights = layer(10 * (index + 1), below, units)
        state = [numbers(10 * (index + 1) + 3 + k, batch, units, scale=0.5) for k in range(2)]
        for name, tensor in zip(["input weights", "recurrent weights", "bias", "hidden", "cell"], weights + state):
            named[f"{name} {index}"] = tensor
        module = torch.nn.LSTMCell(below, units)
        parameters = {"weight_ih": weights[0].T, "weight_hh": weights[1].T, "bias_ih": weights[2]}
        parameters["bias_hh"] = torch.zeros(4 * units)
        cells.append((module, parameters, state))
        below = units
    rows = []
    for row, length in enumerate(lengths):
        x = first[row : row + 1]
        states = [tuple(tensor[row : row + 1] for tensor in state) for _, _, state in cells]
        steps = []
        for _ in range(length):
            heard = x
            for index, (module, parameters, _) in enumerate(cells):
                states[index] = torch.func.functional_call(module, parameters, (heard, states[index]))
                heard = states[index][0]
            said = heard @ projection + bias
            said = said if words else torch.tanh(said)
            steps.append(said)
            x = table[said.argmax(1)] if words else said
        steps.append(torch.zeros(width - length, outputs))
        rows.append(torch.cat(steps))
    out = torch.stack(rows)
    loss = (out * numbers(7, *out.shape)).sum()
    return {
        "kind": "words" if words else "actions",
        "lengths": lengths,
        "width": width,
        "feature": feature,
        "outputs": outputs,
        "hidden": hidden,
        "output": flat(out),
        "gradients": gradients(loss, named),
    }


def main():
    mixes = [[3, 3], [1, 5, 2]]
    cases = [sequence(lengths, 6, direction) for lengths in mixes for direction in ("forward", "backward")]
    cases += [closed_loop(lengths, hidden, False) for lengths in mixes for hidden in ([4], [4, 3, 5])]
    cases += [closed_loop(lengths, [4], True) for lengths in mixes]
    program = f"torch {torch.__version__}"
    json.dump({"program": program, "command": "python tests/golden/make_recurrent.py", "cases": cases}, sys.stdout)
    print()


if __name__ == "__main__":
    main()
