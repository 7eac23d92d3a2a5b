"""Reads a recording with the Python packages mcap and mcap-ros2-support and compares it with what was written.

Usage: read_recording.py RECORDING.mcap EXPECTED.json
Exits non-zero with the first difference.
"""

import json
import sys

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

POSE_TOLERANCE = 2e-6
ANGLE_TOLERANCE = 3e-8
EFFORT_TOLERANCE = 8e-6


def matrix(translation, quaternion_xyzw):
    """Homogeneous 4 x 4 matrix of a pose."""
    x, y, z, w = np.asarray(quaternion_xyzw) / np.linalg.norm(quaternion_xyzw)
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = translation
    return pose


def world_poses(message):
    """Pose in the world of every frame of a TFMessage."""
    poses = {"world": np.eye(4)}
    for stamped in message.transforms:
        t, q = stamped.transform.translation, stamped.transform.rotation
        local = matrix([t.x, t.y, t.z], [q.x, q.y, q.z, q.w])
        poses[stamped.child_frame_id] = poses[stamped.header.frame_id] @ local
    return poses


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def check(name, read, written, tolerance):
    read, written = np.asarray(read, dtype=float), np.asarray(written, dtype=float)
    if read.shape != written.shape:
        sys.exit(f"{name}: {read.shape} values read, {written.shape} written")
    worst = float(np.max(np.abs(read - written), initial=0.0))
    if not worst <= tolerance:
        sys.exit(f"{name}: off by {worst}, more than {tolerance}")
    WORST[name.split(" at ")[0]] = max(WORST.get(name.split(" at ")[0], 0.0), worst)


WORST = {}


def main():
    recording, expected_path = sys.argv[1:]
    with open(expected_path, encoding="utf-8") as file:
        expected = json.load(file)
    by_topic = {}
    with open(recording, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            by_topic.setdefault(channel.topic, {}).setdefault(message.log_time, []).append(decoded)
        attachments = {attachment.name for attachment in reader.iter_attachments()}
        metadata = {record.name for record in reader.iter_metadata()}
    if attachments != {"robot.urdf", "settings.toml", "result.json"}:
        sys.exit(f"attachments {attachments}")
    if metadata != {"rollout", "run", "outcome", "scores"}:
        sys.exit(f"metadata {metadata}")
    ((caption,),) = by_topic["/caption"].values()
    if caption.data != expected["caption"]:
        sys.exit(f"caption {caption.data!r}")

    for sample in expected["samples"]:
        time = sample["time_ns"]

        def at(topic):
            (message,) = by_topic[topic][time]
            stamp = message.header.stamp if hasattr(message, "header") else None
            if stamp is not None and stamp.sec * 10**9 + stamp.nanosec != time:
                sys.exit(f"{topic} at {time}: stamped {stamp.sec} s {stamp.nanosec} ns")
            return message

        for topic, prefix, key in [
            ("/tf", "", "world_from_segment"),
            ("/reference/tf", "reference/", "reference_world_from_segment"),
        ]:
            poses = world_poses(at(topic))
            for name, pose in zip(expected["segments"], sample[key], strict=True):
                check(f"{topic} at {time} {name}", poses[prefix + name], matrix(pose[:3], pose[3:]), POSE_TOLERANCE)
        joints = at("/joint_states")
        if list(joints.name) != expected["joints"]:
            sys.exit(f"joint names {joints.name}")
        check(f"angles at {time}", joints.position, sample["joint_angles_rad"], ANGLE_TOLERANCE)
        check(f"speeds at {time}", joints.velocity, sample["joint_velocities_rad_s"], EFFORT_TOLERANCE)
        check(f"torques at {time}", joints.effort, sample["joint_torques_nm"], EFFORT_TOLERANCE)
        cloud = at("/contact_points")
        points = np.frombuffer(bytes(cloud.data), dtype="<f4").reshape(-1, 4)
        contacts = np.asarray(sample["contacts"], dtype=np.float32).reshape(-1, 4)
        check(f"contacts at {time}", points, contacts, 0.0)
        check(f"ground force at {time}", xyz(at("/contact_wrench").wrench.force), sample["ground_force_n"], EFFORT_TOLERANCE)
        check(f"assist moment at {time}", xyz(at("/assist_wrench").wrench.torque), sample["assist_moment_nm"], EFFORT_TOLERANCE)
        metrics = at("/metrics")
        values = [getattr(metrics, name) for name in expected["metrics"]]
        if not np.all(np.isfinite(values)):
            sys.exit(f"metrics at {time}: {values}")

    for name, worst in sorted(WORST.items()):
        print(f"{name}: largest difference {worst:.2e}")
    print(f"{len(expected['samples'])} samples agree")


if __name__ == "__main__":
    main()
