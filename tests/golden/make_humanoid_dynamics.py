"""Writes humanoid_dynamics.json: inverse dynamics of urdf/mmm_humanoid.urdf as MuJoCo and Pinocchio compute it.

    pip install -r tests/golden/requirements.txt
    python tests/golden/make_humanoid_dynamics.py

Random states, speeds and accelerations, no contact; gravity 9.81 m/s^2 down.
Both programs must agree with each other; otherwise nothing is written.
SI units; the root's velocity, acceleration and wrench are in the world, moments about the root's origin.
"""

import hashlib
import json
import pathlib
import sys

import mujoco
import numpy as np
import pinocchio
from make_humanoid_fk import URDF, rotation

OUT = pathlib.Path(__file__).resolve().with_name("humanoid_dynamics.json")
COMMAND = "python tests/golden/make_humanoid_dynamics.py"
SEED = 45
NUM_STATES = 12
# Relative to the largest torque of the state.
AGREEMENT = 1e-11


def by_mujoco(model, data, state, angles, speeds, accelerations):
    turn = state["rotation"]
    data.qpos[:3] = state["position"]
    mujoco.mju_mat2Quat(data.qpos[3:7], turn.flatten())
    # A free joint turns in its own frame and moves in the world's.
    data.qvel[:6] = [*state["velocity"], *(turn.T @ state["angular_velocity"])]
    data.qacc[:6] = [*state["acceleration"], *(turn.T @ state["angular_acceleration"])]
    for name, angle in angles.items():
        joint = data.joint(name)
        joint.qpos, joint.qvel, joint.qacc = angle, speeds[name], accelerations[name]
    wanted = data.qacc.copy()
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    data.qacc[:] = wanted
    mujoco.mj_inverse(model, data)
    force = data.qfrc_inverse
    torques = {name: float(force[model.joint(name).dofadr[0]]) for name in angles}
    return torques, force[:3].copy(), turn @ force[3:6]


def by_pinocchio(model, data, state, angles, speeds, accelerations):
    turn = state["rotation"]
    q, v, a = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    q[:3], q[3:7] = state["position"], pinocchio.Quaternion(turn).coeffs()
    # All in the root's frame, the acceleration as a spatial one.
    v[:3], v[3:6] = turn.T @ state["velocity"], turn.T @ state["angular_velocity"]
    a[:3] = turn.T @ state["acceleration"] - np.cross(v[3:6], v[:3])
    a[3:6] = turn.T @ state["angular_acceleration"]
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q], v[joint.idx_v], a[joint.idx_v] = angle, speeds[name], accelerations[name]
    force = pinocchio.rnea(model, data, q, v, a)
    torques = {name: float(force[model.joints[model.getJointId(name)].idx_v]) for name in angles}
    return torques, turn @ force[:3], turn @ force[3:6]


def exact(values):
    return [float(value) for value in values]


def main():
    spec = mujoco.MjSpec.from_file(str(URDF))
    spec.body("pelvis").add_freejoint()
    spec.option.gravity = [0, 0, -9.81]
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    mj_model = spec.compile()
    mj_data = mujoco.MjData(mj_model)
    pin_model = pinocchio.buildModelFromUrdf(str(URDF), pinocchio.JointModelFreeFlyer())
    pin_model.gravity.linear = np.array([0, 0, -9.81])
    pin_data = pin_model.createData()
    hinges = [mj_model.joint(i) for i in range(mj_model.njnt) if mj_model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]

    rng = np.random.default_rng(SEED)
    states, worst = [], 0.0
    for _ in range(NUM_STATES):
        draw = lambda scale: np.round(rng.uniform(-scale, scale, 3), 6)
        rpy = np.round(rng.uniform(-1, 1, 3) * [np.pi, 1.5, np.pi], 6)
        state = {
            "position": draw(2),
            "rotation": rotation(*rpy),
            "velocity": draw(3),
            "angular_velocity": draw(4),
            "acceleration": draw(10),
            "angular_acceleration": draw(20),
        }
        angles = {hinge.name: round(float(rng.uniform(*hinge.range)), 6) for hinge in hinges}
        speeds = {hinge.name: round(float(rng.uniform(-5, 5)), 6) for hinge in hinges}
        accelerations = {hinge.name: round(float(rng.uniform(-50, 50)), 6) for hinge in hinges}
        ours = by_mujoco(mj_model, mj_data, state, angles, speeds, accelerations)
        theirs = by_pinocchio(pin_model, pin_data, state, angles, speeds, accelerations)
        scale = max(abs(torque) for torque in theirs[0].values())
        gaps = [abs(ours[0][name] - theirs[0][name]) for name in angles]
        gaps += list(np.abs(ours[1] - theirs[1])) + list(np.abs(ours[2] - theirs[2]))
        worst = max(worst, max(gaps) / scale)
        states.append(
            {
                "root_position_m": exact(state["position"]),
                "root_rpy_rad": exact(rpy),
                "root_velocity_m_s": exact(state["velocity"]),
                "root_angular_velocity_rad_s": exact(state["angular_velocity"]),
                "root_acceleration_m_s2": exact(state["acceleration"]),
                "root_angular_acceleration_rad_s2": exact(state["angular_acceleration"]),
                "angles_rad": angles,
                "speeds_rad_s": speeds,
                "accelerations_rad_s2": accelerations,
                "torques_nm": theirs[0],
                "root_force_n": exact(theirs[1]),
                "root_moment_nm": exact(theirs[2]),
            }
        )
    if worst > AGREEMENT:
        sys.exit(f"MuJoCo and Pinocchio differ by {worst:g} of the largest torque")
    golden = {
        "command": COMMAND,
        "programs": {"mujoco": mujoco.__version__, "pinocchio": pinocchio.__version__, "numpy": np.__version__},
        "seed": SEED,
        "urdf_sha256": hashlib.sha256(URDF.read_bytes()).hexdigest(),
        "largest_difference_of_the_programs": worst,
        "states": states,
    }
    OUT.write_text(json.dumps(golden, indent=1) + "\n")
    print(f"{OUT.name}: {len(states)} states; the programs differ by {worst:.2g} of the largest torque")


if __name__ == "__main__":
    main()
