"""Writes humanoid_fk.json: kinematics of urdf/mmm_humanoid.urdf as MuJoCo and Pinocchio compute it.

    pip install -r tests/golden/requirements.txt
    python tests/golden/make_humanoid_fk.py

Both programs must load the file without a word and agree with each other; otherwise nothing is written.
Lengths in metres, angles in radians, quaternions as w x y z, all in the world of the root pose.
"""

import contextlib
import hashlib
import json
import os
import pathlib
import sys
import tempfile

import mujoco
import numpy as np
import pinocchio

ROOT = pathlib.Path(__file__).resolve().parents[2]
URDF = ROOT / "urdf" / "mmm_humanoid.urdf"
OUT = pathlib.Path(__file__).resolve().with_name("humanoid_fk.json")
COMMAND = "python tests/golden/make_humanoid_fk.py"
SEED = 44
NUM_STATES = 20
# The point of the Jacobians, in the frame of its link.
POINT_IN_LINK = np.array([0.03, -0.05, 0.07])
AGREEMENT = 1e-12


@contextlib.contextmanager
def silence_required(program):
    """Fails if the block writes anything to stdout or stderr, from Python or from native code."""
    with tempfile.TemporaryFile() as spoken:
        kept = [os.dup(1), os.dup(2)]
        try:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(spoken.fileno(), 1)
            os.dup2(spoken.fileno(), 2)
            yield
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            for descriptor in kept:
                os.close(descriptor)
        spoken.seek(0)
        words = spoken.read().decode(errors="replace").strip()
        if words:
            sys.exit(f"{program} complains about {URDF.name}: {words}")


def rotation(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rz @ ry @ rx


class MuJoCo:
    """Kinematics by MuJoCo."""

    def __init__(self):
        with silence_required("MuJoCo"):
            # Loaded as it stands first: a freely moving root must not hide a fault.
            mujoco.MjModel.from_xml_path(str(URDF))
            spec = mujoco.MjSpec.from_file(str(URDF))
            spec.body("pelvis").add_freejoint()
            self.model = spec.compile()
            self.data = mujoco.MjData(self.model)

    def move(self, position, rotation_matrix, angles):
        self.data.qpos[:3] = position
        mujoco.mju_mat2Quat(self.data.qpos[3:7], rotation_matrix.flatten())
        for name, angle in angles.items():
            self.data.joint(name).qpos = angle
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def pose(self, link):
        body = self.data.body(link)
        return body.xpos.copy(), body.xmat.reshape(3, 3).copy()

    def mass(self):
        return float(self.model.body("pelvis").subtreemass[0])

    def center_of_mass(self):
        return self.data.body("pelvis").subtree_com.copy()

    def jacobian(self, link, point, joints):
        full = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, full, None, point, self.model.body(link).id)
        return {name: full[:, self.model.joint(name).dofadr[0]] for name in joints}


class Pinocchio:
    """Kinematics by Pinocchio."""

    def __init__(self):
        with silence_required("Pinocchio"):
            self.model = pinocchio.buildModelFromUrdf(str(URDF), pinocchio.JointModelFreeFlyer())
            self.data = self.model.createData()

    def move(self, position, rotation_matrix, angles):
        q = pinocchio.neutral(self.model)
        q[:3] = position
        q[3:7] = pinocchio.Quaternion(rotation_matrix).coeffs()
        for name, angle in angles.items():
            q[self.model.joints[self.model.getJointId(name)].idx_q] = angle
        pinocchio.computeJointJacobians(self.model, self.data, q)
        pinocchio.updateFramePlacements(self.model, self.data)
        pinocchio.centerOfMass(self.model, self.data, q)

    def pose(self, link):
        frame = self.data.oMf[self.model.getFrameId(link)]
        return frame.translation.copy(), frame.rotation.copy()

    def mass(self):
        return float(pinocchio.computeTotalMass(self.model))

    def center_of_mass(self):
        return self.data.com[0].copy()

    def jacobian(self, link, point, joints):
        frame = self.model.getFrameId(link)
        aligned = pinocchio.getFrameJacobian(
            self.model, self.data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        lever = point - self.data.oMf[frame].translation
        at_point = aligned[:3] + np.cross(aligned[3:].T, lever).T
        return {name: at_point[:, self.model.joints[self.model.getJointId(name)].idx_v] for name in joints}


def numbers(values):
    return [round(float(value), 11) + 0.0 for value in values]


def main():
    programs = [MuJoCo(), Pinocchio()]
    model = programs[0].model
    joints = [model.joint(i) for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    limits = {joint.name: joint.range.copy() for joint in joints}
    # The frames between the axes of one anatomical joint are named after the axis; they follow from the others.
    links = [model.body(i).name for i in range(1, model.nbody) if not model.body(i).name.endswith("_link")]

    worst = {"position_m": 0.0, "rotation": 0.0, "center_of_mass_m": 0.0, "jacobian_m": 0.0}

    def agree(what, a, b):
        worst[what] = max(worst[what], float(np.abs(a - b).max()))
        if worst[what] > AGREEMENT:
            sys.exit(f"MuJoCo and Pinocchio differ by {worst[what]:g} in {what}")

    rng = np.random.default_rng(SEED)
    states = []
    for index in range(NUM_STATES):
        angles = {name: round(float(rng.uniform(*limits[name])), 6) for name in limits}
        position = np.round(rng.uniform(-2, 2, 3), 6)
        rpy = np.round(rng.uniform(-1, 1, 3) * [np.pi, 1.5, np.pi], 6)
        for program in programs:
            program.move(position, rotation(*rpy), angles)

        state = {
            "root_position_m": numbers(position),
            "root_rpy_rad": numbers(rpy),
            "angles_rad": angles,
            "links": {},
        }
        for link in links:
            (here, turned), (there, turned_there) = (program.pose(link) for program in programs)
            agree("position_m", here, there)
            agree("rotation", turned, turned_there)
            quaternion = np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, turned.flatten())
            state["links"][link] = numbers([*here, *quaternion])
        agree("center_of_mass_m", *(program.center_of_mass() for program in programs))
        state["center_of_mass_m"] = numbers(programs[0].center_of_mass())

        link = links[(5 * index + 4) % len(links)]
        here, turned = programs[0].pose(link)
        point = here + turned @ POINT_IN_LINK
        columns, columns_there = (program.jacobian(link, point, limits) for program in programs)
        for name in limits:
            agree("jacobian_m", columns[name], columns_there[name])
        state["jacobian"] = {
            "link": link,
            "columns_m": {name: numbers(column) for name, column in columns.items() if np.any(column)},
        }
        states.append(state)

    masses = [program.mass() for program in programs]
    if abs(masses[0] - masses[1]) > 1e-9:
        sys.exit(f"MuJoCo and Pinocchio differ in mass: {masses}")

    golden = {
        "programs": {"mujoco": mujoco.__version__, "pinocchio": pinocchio.__version__, "numpy": np.__version__},
        "command": COMMAND,
        "seed": SEED,
        "urdf_sha256": hashlib.sha256(URDF.read_bytes()).hexdigest(),
        "largest_difference_between_programs": worst,
        "mass_kg": numbers(masses[:1])[0],
        "point_in_link_m": numbers(POINT_IN_LINK),
        "states": states,
    }
    # One line per link or joint table keeps differences readable without a line per number.
    text = json.dumps(golden, indent=1)
    for pattern in ("\n     ", "\n    ", "\n   "):
        text = text.replace(pattern, " ")
    OUT.write_text(text + "\n")
    print(f"{OUT}: {len(states)} states, {len(links)} links, programs agree to {worst}")


if __name__ == "__main__":
    main()
