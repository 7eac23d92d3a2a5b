"""Tracks a motion in MuJoCo exactly as the Rust side does, and writes what the body did.

    python benches/peers/tracking_mujoco.py --urdf body.urdf --control control.json --commands commands.csv --out out.csv

control.json is that of rollout_mujoco.py, with these keys besides:

    "segments": names of the links to report, the root first
    "assist": {"force_n": 137.0, "moment_nm": 68.0,
               "linear": [2000, 400], "angular": [3000, 300]}    bounds; stiffness and damping
    "steps_per_sample": 4

commands.csv has one row a step of control.json's dt: angles, speeds and feed-forward torques of its joints, then position,
quaternion (w x y z), velocity and angular velocity of the root, all in the world.

--substeps N makes N steps of dt / N for every row, between whose values the commands are interpolated.

out.csv has one row a sample, the first before the first step: for every segment position (3), quaternion (w x y z), mean
force of the ground (3) and the point it acts at (3; zero without force); then the mean assist force (3).

The assist is a spring and damper at the root with a bound on the length of its force and of its moment. Its damping is
implicit, as a damping of the free joint, its spring explicit.
"""

import argparse
import json
import pathlib

import mujoco
import numpy as np

from rollout_mujoco import INTEGRATORS, build


class Commands:
    """Rows of the commands at any time."""

    def __init__(self, path, num_joints, dt):
        self.table = np.loadtxt(path, delimiter=",", ndmin=2)
        self.num_joints, self.dt = num_joints, dt

    def at(self, time):
        place = np.clip(time / self.dt, 0, len(self.table) - 1)
        row = int(place)
        after = min(row + 1, len(self.table) - 1)
        share = place - row
        values = (1 - share) * self.table[row] + share * self.table[after]
        n = self.num_joints
        root = values[3 * n :]
        quaternion = root[3:7] / np.linalg.norm(root[3:7])
        return values[:n], values[n : 2 * n], values[2 * n : 3 * n], root[:3], quaternion, root[7:10], root[10:13]


def bounded(vector, limit):
    """The share of a vector that keeps it within a length."""
    length = np.linalg.norm(vector)
    return 1.0 if length <= limit else limit / length


class Tracking:
    def __init__(self, model, control, commands):
        self.model, self.control, self.commands = model, control, commands
        self.data = mujoco.MjData(model)
        self.gains = np.array([(j["stiffness_nm_rad"], j["damping_nms_rad"]) for j in control["joints"]])
        names = [joint["name"] for joint in control["joints"]]
        self.qpos = np.array([model.joint(name).qposadr[0] for name in names], dtype=int)
        self.qvel = np.array([model.joint(name).dofadr[0] for name in names], dtype=int)
        self.segments = [model.body(name).id for name in control["segments"]]
        self.segment_of_body = {body: index for index, body in enumerate(self.segments)}
        self.ground = model.geom("ground").id
        angles, speeds, _, position, quaternion, velocity, omega = commands.at(0.0)
        self.data.qpos[:3], self.data.qpos[3:7], self.data.qpos[self.qpos] = position, quaternion, angles
        self.data.qvel[:3], self.data.qvel[self.qvel] = velocity, speeds
        self.data.qvel[3:6] = self.to_local(omega, quaternion)
        mujoco.mj_forward(model, self.data)

    @staticmethod
    def to_local(vector, quaternion):
        turned, back = np.zeros(3), np.zeros(4)
        mujoco.mju_negQuat(back, quaternion)
        mujoco.mju_rotVecQuat(turned, vector, back)
        return turned

    def step(self):
        """One step; the assist force in the world."""
        model, data = self.model, self.data
        angles, speeds, torques, position, quaternion, velocity, omega = self.commands.at(data.time)
        data.ctrl[:] = angles + (speeds * self.gains[:, 1] + torques) / self.gains[:, 0]
        assist, force = self.control["assist"], np.zeros(3)
        if assist["force_n"] > 0:
            kp, kd = assist["linear"]
            spring = kp * (position - data.qpos[:3]) + kd * velocity
            share = bounded(spring - kd * data.qvel[:3], assist["force_n"])
            data.qfrc_applied[:3] = share * spring
            model.dof_damping[:3] = share * kd
            kp, kd = assist["angular"]
            turn, back, axis = np.zeros(4), np.zeros(4), np.zeros(3)
            mujoco.mju_negQuat(back, data.qpos[3:7])
            mujoco.mju_mulQuat(turn, back, quaternion)
            mujoco.mju_quat2Vel(axis, turn, 1.0)
            spring = kp * axis + kd * self.to_local(omega, data.qpos[3:7])
            share_turn = bounded(spring - kd * data.qvel[3:6], assist["moment_nm"])
            data.qfrc_applied[3:6] = share_turn * spring
            model.dof_damping[3:6] = share_turn * kd
        mujoco.mj_step(model, data)
        if assist["force_n"] > 0:
            force = data.qfrc_applied[:3] - model.dof_damping[:3] * data.qvel[:3]
        return force

    def add_contacts(self, forces, weighted, pushes):
        wrench = np.zeros(6)
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            if self.ground not in (contact.geom1, contact.geom2) or contact.efc_address < 0:
                continue
            other = contact.geom2 if contact.geom1 == self.ground else contact.geom1
            segment = self.segment_of_body.get(self.model.geom_bodyid[other])
            mujoco.mj_contactForce(self.model, self.data, index, wrench)
            if segment is None or wrench[0] <= 0:
                continue
            # The frame's rows are its axes; the force acts from the first geometry on the second.
            force = contact.frame.reshape(3, 3).T @ wrench[:3]
            forces[segment] += force if contact.geom1 == self.ground else -force
            weighted[segment] += contact.pos * wrench[0]
            pushes[segment] += wrench[0]

    def run(self, num_rows, substeps):
        per_sample = self.control["steps_per_sample"] * substeps
        rows, n = [], len(self.segments)
        forces, weighted, pushes, assist = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros(3)
        rows.append(self.row(forces, weighted, assist))
        for step in range(num_rows * substeps):
            assist += self.step()
            self.add_contacts(forces, weighted, pushes)
            if (step + 1) % per_sample == 0:
                points = weighted / np.maximum(pushes, 1e-12)[:, None]
                rows.append(self.row(forces / per_sample, points, assist / per_sample))
                forces[:], weighted[:], pushes[:], assist[:] = 0, 0, 0, 0
        return np.array(rows)

    def row(self, forces, points, assist):
        # A step ends before the poses follow the joints.
        mujoco.mj_kinematics(self.model, self.data)
        columns = [self.data.xpos[self.segments], self.data.xquat[self.segments], forces, points]
        return np.concatenate([np.concatenate(columns, axis=1).ravel(), assist])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("urdf", "control", "commands", "out"):
        parser.add_argument(f"--{name}", type=pathlib.Path, required=True)
    parser.add_argument("--substeps", type=int, default=1)
    parser.add_argument("--integrator", choices=INTEGRATORS, default="implicitfast")
    arguments = parser.parse_args()
    control = json.loads(arguments.control.read_text())
    commands = Commands(arguments.commands, len(control["joints"]), control["dt_secs"])
    num_rows = len(commands.table)
    control["dt_secs"] /= arguments.substeps
    model = build(arguments.urdf, control, arguments.integrator)
    rows = Tracking(model, control, commands).run(num_rows, arguments.substeps)
    np.savetxt(arguments.out, rows, delimiter=",", fmt="%.9g")
    print(json.dumps({"program": "mujoco", "version": mujoco.__version__, "samples": len(rows)}))


if __name__ == "__main__":
    main()
