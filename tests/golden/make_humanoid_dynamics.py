"""Writes humanoid_dynamics.json: the dynamics of urdf/mmm_humanoid.urdf as MuJoCo and Pinocchio compute it.

    pip install -r tests/golden/requirements.txt
    python tests/golden/make_humanoid_dynamics.py

Random states, speeds and accelerations, no contact; gravity 9.81 m/s^2 down.
Inverse dynamics; mass matrix; centre of mass, its Jacobian, and angular momentum about it; the Jacobian of a hand.
A generalised velocity is the root's (3), its angular velocity (3), both in the world, then the joints' by name.
Of matrices the products with random velocities are kept, which a wrong entry anywhere changes.
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


HAND, POINT = "left_hand", np.array([0.01, 0.02, -0.05])


def names_of(angles):
    return sorted(angles)


def matrices_by_mujoco(model, data, state, angles):
    """Mass matrix, CoM, its Jacobian, centroidal angular momentum matrix and hand Jacobian in our velocity."""
    turn, names = state["rotation"], names_of(angles)
    order = list(range(6)) + [int(model.joint(name).dofadr[0]) for name in names]
    data.qvel[:] = 0
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    hand = data.body(HAND)
    point = hand.xpos + hand.xmat.reshape(3, 3) @ POINT
    position, rotation_ = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, position, rotation_, point, model.body(HAND).id)
    com = np.zeros((3, model.nv))
    mujoco.mj_jacSubtreeCom(model, data, com, model.body("pelvis").id)
    momentum = np.zeros((3, model.nv))
    mujoco.mj_angmomMat(model, data, momentum, model.body("pelvis").id)
    # MuJoCo's free joint turns in its own frame, ours in the world's.
    own = np.eye(model.nv)
    own[3:6, 3:6] = turn.T
    pick = lambda matrix: (matrix @ own)[:, order]
    mass = (own.T @ full @ own)[np.ix_(order, order)]
    return mass, data.subtree_com[model.body("pelvis").id].copy(), pick(com), pick(momentum), pick(np.vstack([position, rotation_]))


def matrices_by_pinocchio(model, data, state, angles):
    turn, names = state["rotation"], names_of(angles)
    q = pinocchio.neutral(model)
    q[:3], q[3:7] = state["position"], pinocchio.Quaternion(turn).coeffs()
    for name, angle in angles.items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    order = list(range(6)) + [model.joints[model.getJointId(name)].idx_v for name in names]
    own = np.eye(model.nv)
    own[:3, :3] = own[3:6, 3:6] = turn.T
    full = pinocchio.crba(model, data, q)
    full = np.triu(full) + np.triu(full, 1).T
    com = pinocchio.jacobianCenterOfMass(model, data, q)
    centroidal = pinocchio.ccrba(model, data, q, np.zeros(model.nv)).copy()
    frame = model.getFrameId(HAND)
    pinocchio.forwardKinematics(model, data, q)
    pinocchio.updateFramePlacements(model, data)
    hand = pinocchio.computeFrameJacobian(model, data, q, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    lever = data.oMf[frame].rotation @ POINT
    hand[:3] += np.cross(hand[3:].T, lever).T
    pick = lambda matrix: (matrix @ own)[:, order]
    mass = (own.T @ full @ own)[np.ix_(order, order)]
    return mass, data.com[0].copy(), pick(com), pick(centroidal[3:]), pick(hand)


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
        ours_all = matrices_by_mujoco(mj_model, mj_data, state, angles)
        theirs_all = matrices_by_pinocchio(pin_model, pin_data, state, angles)
        for one, other in zip(ours_all, theirs_all):
            worst = max(worst, np.abs(one - other).max() / np.abs(other).max())
        mass, com, com_jacobian, momentum, hand = theirs_all
        # What the matrices do to the state's own velocity.
        names = names_of(angles)
        velocity = np.concatenate([state["velocity"], state["angular_velocity"], [speeds[name] for name in names]])
        product = mass @ velocity
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
                "momentum_of_root": exact(product[:6]),
                "momentum_of_joints": dict(zip(names, exact(product[6:]))),
                "mass_diagonal_of_joints": dict(zip(names, exact(np.diag(mass)[6:]))),
                "kinetic_energy_j": float(velocity @ product / 2),
                "com_m": exact(com),
                "com_velocity_m_s": exact(com_jacobian @ velocity),
                "angular_momentum_kgm2_s": exact(momentum @ velocity),
                "hand_velocity": exact(hand @ velocity),
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
