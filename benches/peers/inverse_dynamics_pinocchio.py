"""Times Pinocchio's inverse dynamics on a URDF: one line of JSON for every line on standard input.

    pip install -r benches/peers/requirements.txt
    python benches/peers/inverse_dynamics_pinocchio.py --urdf FILE --calls N

The time of a call from Python is measured on a body of one joint, less what that body costs, and taken off.
Forward kinematics is part of `rnea`, as it is of our side.
"""

import argparse
import json
import pathlib
import sys
import time

import numpy as np
import pinocchio


def seconds_per_call(model, states, calls):
    data = model.createData()
    rnea, count = pinocchio.rnea, len(states)
    start = time.process_time()
    for index in range(calls):
        rnea(model, data, *states[index % count])
    return (time.process_time() - start) / calls


def random_states(model, rng):
    draw = lambda: rng.uniform(-1, 1, model.nv)
    return [(pinocchio.integrate(model, pinocchio.neutral(model), draw()), draw(), draw()) for _ in range(64)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--urdf", type=pathlib.Path, required=True)
    parser.add_argument("--calls", type=int, default=20000)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    model = pinocchio.buildModelFromUrdf(str(arguments.urdf), pinocchio.JointModelFreeFlyer())
    states = random_states(model, rng)
    # A model of one hinge costs as much to call and next to nothing to compute.
    small = pinocchio.Model()
    small.addJoint(0, pinocchio.JointModelRZ(), pinocchio.SE3.Identity(), "hinge")
    small_states = random_states(small, rng)
    print(json.dumps({"ready": True, "version": pinocchio.__version__, "nv": model.nv}), flush=True)
    for _ in sys.stdin:
        overhead = seconds_per_call(small, small_states, arguments.calls)
        whole = seconds_per_call(model, states, arguments.calls)
        result = {"secs_per_call": whole - overhead, "call_overhead_secs": overhead}
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
