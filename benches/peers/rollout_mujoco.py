"""Steps per CPU second of MuJoCo on the body, gains and ground that the Rust side simulates.

    python benches/peers/rollout_mujoco.py --urdf body.urdf --control control.json --steps 5000

Prints one JSON object a line: the speed, and what the body did meanwhile, so that a fast fall is not taken for speed.
A run that becomes unstable has "completed": false and no speed.
With --on-request it prints {"ready": true} once loaded, then one measurement, from the start, for every line on stdin: so
another program can run it in turn with its own measurements, without paying for the start each time.

control.json says what to simulate, in SI units and radians:

    {
      "dt_secs": 0.0020833, "gravity_m_s2": 9.81, "friction": 0.8,
      "root_position_m": [0, 0, 0.93], "root_quaternion_wxyz": [1, 0, 0, 0],
      "joints": [
        {"name": "LKx_joint", "stiffness_nm_rad": 1000, "damping_nms_rad": 50, "effort_nm": 400, "target_rad": 0.0},
        ...
      ],
      "added_inertia_kgm2": {"left_foot": 0.022, ...}
    }

added_inertia_kgm2 (optional) is added to the rotational inertia of a link about all three axes.
Joints missing from the list move freely.

--targets is a table of one row per step, as .npy or as .csv without a header: the target angles of the listed joints, or
those followed by their target speeds. The last row is held. Without it, target_rad is held.

The same on both sides: masses, shapes against a plane at z = 0 and no contact of the body with itself, joint springs
stiffness * (target - angle) + damping * (target speed - speed) limited by effort, step length, start. A cylinder with a
sphere at either end becomes one capsule. Joint limits are off and no assist acts on the root.
MuJoCo's own defaults stay: Newton solver, pyramidal friction cones, contact softness.
"""

import argparse
import json
import pathlib
import sys
import time

import mujoco
import mujoco.rollout
import numpy as np

INTEGRATORS = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
GROUND, BODY = 1, 2


def merge_capsules(spec, body):
    """Replaces each cylinder of a body that has spheres of its radius at both ends by the capsule it is."""
    geoms = list(body.geoms)
    spheres = [geom for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_SPHERE]
    for cylinder in (geom for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER):
        radius, half = cylinder.size[:2]
        along = np.zeros(3)
        mujoco.mju_rotVecQuat(along, np.array([0.0, 0.0, half]), np.asarray(cylinder.quat))
        ends = []
        for end in (cylinder.pos - along, cylinder.pos + along):
            ends += [s for s in spheres if abs(s.size[0] - radius) < 1e-9 and np.linalg.norm(s.pos - end) < 1e-7][:1]
        if len(ends) == 2:
            cylinder.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            for sphere in ends:
                spheres.remove(sphere)
                spec.delete(sphere)


def build(urdf, control, integrator):
    """The model: free root, ground, springs."""
    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.option.timestep = control["dt_secs"]
    spec.option.gravity = [0.0, 0.0, -control["gravity_m_s2"]]
    spec.option.integrator = INTEGRATORS[integrator]

    root = spec.worldbody.first_body()
    root.add_freejoint()
    root.pos = control["root_position_m"]
    root.quat = control["root_quaternion_wxyz"]
    friction = [control["friction"], 0.005, 0.0001]
    for body in spec.bodies[1:]:
        merge_capsules(spec, body)
    for geom in spec.geoms:
        geom.contype, geom.conaffinity, geom.condim, geom.friction = BODY, GROUND, 3, friction
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[500, 500, 1],
        contype=GROUND,
        conaffinity=BODY,
        condim=3,
        friction=friction,
    )
    for joint in spec.joints:
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for joint in control["joints"]:
        actuator = spec.add_actuator(
            name=joint["name"], target=joint["name"], trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        actuator.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0] = joint["stiffness_nm_rad"]
        actuator.biasprm[1] = -joint["stiffness_nm_rad"]
        actuator.biasprm[2] = -joint["damping_nms_rad"]
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = [-joint["effort_nm"], joint["effort_nm"]]
    model = spec.compile()
    for link, extra in control.get("added_inertia_kgm2", {}).items():
        model.body(link).inertia[:] += extra
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    return model


def read_targets(path, control, num_steps):
    """Control signal per step, and target angles per step, from a table or from the constant targets."""
    joints = control["joints"]
    if path is None:
        table = np.array([[joint["target_rad"] for joint in joints]])
    else:
        table = np.load(path) if path.suffix == ".npy" else np.loadtxt(path, delimiter=",", ndmin=2)
    if table.ndim != 2 or table.shape[1] not in (len(joints), 2 * len(joints)):
        sys.exit(f"{path}: expected {len(joints)} or {2 * len(joints)} columns, found shape {table.shape}")
    table = table[np.minimum(np.arange(num_steps), len(table) - 1)]
    angles, speeds = table[:, : len(joints)], table[:, len(joints) :]
    signal = angles.copy()
    if speeds.size:
        # The spring's damper acts on the difference of speeds; MuJoCo's takes the speed itself.
        per_speed = [joint["damping_nms_rad"] / joint["stiffness_nm_rad"] for joint in joints]
        signal += speeds * per_speed
    return signal, angles


class Rollout:
    """One rollout, repeatable from its start."""

    def __init__(self, model, control, signal, angles):
        self.model, self.signal, self.angles = model, signal, angles
        self.integrator = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower()
        names = [joint["name"] for joint in control["joints"]]
        self.qpos_of_joint = np.array([model.joint(name).qposadr[0] for name in names], dtype=int)
        start = mujoco.MjData(model)
        start.qpos[self.qpos_of_joint] = angles[0]
        mujoco.mj_forward(model, start)
        self.start = self.state(start)
        self.data = mujoco.MjData(model)

    def state(self, data):
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.zeros(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, data, state, kind)
        return state

    def advance(self, start, first, num_steps):
        """States after each step, and CPU seconds; the loop over steps runs inside MuJoCo."""
        signal = self.signal[first : first + num_steps]
        before = time.process_time()
        states, _ = mujoco.rollout.rollout(self.model, self.data, start, signal)
        return states[0], time.process_time() - before

    def measure(self, warm_up, num_steps):
        parts, start = [], self.start
        if warm_up:
            states, _ = self.advance(start, 0, warm_up)
            parts.append(states)
            start = states[-1]
        states, cpu_secs = self.advance(start, warm_up, num_steps)
        parts.append(states)
        states = np.concatenate(parts)
        qpos = states[:, 1 : 1 + self.model.nq]
        error = qpos[:, self.qpos_of_joint] - self.angles[: len(qpos)]
        # Root pose and the joints in the order of control.json, after the time.
        trajectory = np.column_stack([states[:, 0], qpos[:, :7], qpos[:, self.qpos_of_joint]])
        mujoco.mj_setState(self.model, self.data, states[-1], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(self.model, self.data)
        # MuJoCo gives up on an unstable state and repeats it, at no cost: such a run has no speed.
        ended_secs = (warm_up + num_steps) * self.model.opt.timestep
        completed = bool(np.isfinite(states).all() and abs(states[-1, 0] - ended_secs) < 0.5 * self.model.opt.timestep)
        return trajectory, {
            "program": "mujoco",
            "version": mujoco.__version__,
            "integrator": self.integrator,
            "dt_secs": self.model.opt.timestep,
            "degrees_of_freedom": self.model.nv,
            "shapes": self.model.ngeom - 1,
            "warm_up_steps": warm_up,
            "steps": num_steps,
            "cpu_secs": cpu_secs,
            "steps_per_cpu_sec": num_steps / cpu_secs if completed else None,
            "joint_error_rms_rad": float(np.sqrt(np.mean(error[warm_up:] ** 2))) if completed else None,
            "root_height_end_m": float(qpos[-1, 2]) if completed else None,
            "contacts_end": self.data.ncon,
            "completed": completed,
        }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--urdf", type=pathlib.Path, required=True)
    parser.add_argument("--control", type=pathlib.Path, required=True)
    parser.add_argument("--targets", type=pathlib.Path)
    parser.add_argument("--steps", type=int, default=5000, help="steps measured (default 5000)")
    parser.add_argument("--warm-up", type=int, default=500, help="steps before the clock starts (default 500)")
    parser.add_argument("--integrator", choices=INTEGRATORS, default="implicitfast")
    parser.add_argument(
        "--trajectory",
        type=pathlib.Path,
        help="write time, root position, root quaternion (w x y z) and joint angles after every step, as .npy",
    )
    parser.add_argument("--on-request", action="store_true", help="one measurement for every line on stdin")
    arguments = parser.parse_args()
    if arguments.steps < 1 or arguments.warm_up < 0:
        parser.error("--steps must be positive and --warm-up not negative")

    control = json.loads(arguments.control.read_text())
    signal, angles = read_targets(arguments.targets, control, arguments.warm_up + arguments.steps)
    rollout = Rollout(build(arguments.urdf, control, arguments.integrator), control, signal, angles)
    if arguments.on_request:
        print(json.dumps({"ready": True}), flush=True)
    for _ in sys.stdin if arguments.on_request else [None]:
        trajectory, result = rollout.measure(arguments.warm_up, arguments.steps)
        if arguments.trajectory:
            np.save(arguments.trajectory, trajectory)
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
