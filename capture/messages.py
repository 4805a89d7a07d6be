"""The message types of a log, and messages made from our values.

Types are those of ROS 2 Humble, `ackermann_msgs`, f1tenth's `vesc_msgs` (branch ros2), and one of
our own for data sets that bring range-bearing observations.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from capture.cdr import ODOMETRY, filled
from capture.stamps import NS_PER_S
from capture.streams import Observations, Odometry
from capture.topics import DRIVE_TYPE, ODOMETRY_TYPE, RANGE_BEARING_TYPE, VESC_STATE_TYPE
from capture.yaw import yaw_quaternions
from geometry import Floats, Stamps

if TYPE_CHECKING:
    import numpy.typing as npt
    from rosbags.typesys.store import Msg, Typestore

_VESC_STATE = "vesc_msgs/msg/VescState"

_DEFINITIONS = {
    "ackermann_msgs/msg/AckermannDrive": """
        float32 steering_angle
        float32 steering_angle_velocity
        float32 speed
        float32 acceleration
        float32 jerk
    """,
    DRIVE_TYPE: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive",
    _VESC_STATE: """
        int32 FAULT_CODE_NONE=0
        int32 FAULT_CODE_OVER_VOLTAGE=1
        int32 FAULT_CODE_UNDER_VOLTAGE=2
        int32 FAULT_CODE_DRV8302=3
        int32 FAULT_CODE_ABS_OVER_CURRENT=4
        int32 FAULT_CODE_OVER_TEMP_FET=5
        int32 FAULT_CODE_OVER_TEMP_MOTOR=6
        float64 temp_fet
        float64 temp_motor
        float64 current_motor
        float64 current_input
        float64 avg_id
        float64 avg_iq
        float64 duty_cycle
        float64 speed
        float64 voltage_input
        float64 charge_drawn
        float64 charge_regen
        float64 energy_drawn
        float64 energy_regen
        int32 displacement
        int32 distance_traveled
        int32 fault_code
        float64 pid_pos_now
        int32 controller_id
        float64 ntc_temp_mos1
        float64 ntc_temp_mos2
        float64 ntc_temp_mos3
        float64 avg_vd
        float64 avg_vq
    """,
    VESC_STATE_TYPE: "std_msgs/Header header\nvesc_msgs/VescState state",
    RANGE_BEARING_TYPE: """
        std_msgs/Header header
        int32[] landmark_id
        float64[] range_m
        float64[] bearing_rad
    """,
}


@lru_cache(maxsize=2)
def typestore(ros: int = 2) -> Typestore:
    """Every type that we write, as ROS 2 (Humble) or ROS 1 (Noetic) defines it."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, definition in _DEFINITIONS.items():
        lines = "\n".join(line.strip() for line in definition.splitlines())
        store.register(get_types_from_msg(lines, name))
    return store


def definition(type_name: str) -> str:
    """The `ros2msg` definition of a type and all types within, as an MCAP schema holds it."""
    text, _ = typestore().generate_msgdef(type_name, ros_version=2)
    return text


def serialised(message: object, type_name: str) -> bytes:
    """A message as little-endian CDR."""
    return bytes(typestore().serialize_cdr(message, type_name, little_endian=True))


def header(t_ns: int, frame_id: str) -> Msg:
    """A `std_msgs/Header` with a stamp."""
    types = typestore().types
    seconds, nanoseconds = divmod(t_ns, NS_PER_S)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)


def odometry_messages(
    odometry: Odometry,
    pose_covariance: Floats | None = None,
    twist_covariance: Floats | None = None,
) -> list[bytes]:
    """One `nav_msgs/Odometry` per pose; covariances (n, 36), None for zero, that is unknown."""
    zero, unknown = np.zeros(odometry.t_ns.size), np.zeros((odometry.t_ns.size, 36))
    seconds, nanoseconds = split_stamps(odometry.t_ns)
    pose = odometry.pose_odom_base
    return filled(
        serialised(_empty_odometry(), ODOMETRY_TYPE),
        ODOMETRY,
        {
            "sec": seconds,
            "nanosec": nanoseconds,
            "position": np.stack([pose[:, 0], pose[:, 1], zero], axis=1),
            "orientation": yaw_quaternions(pose[:, 2]),
            "linear": np.stack([odometry.speed_m_s, zero, zero], axis=1),
            "angular": np.stack([zero, zero, odometry.yaw_rate_rad_s], axis=1),
            "pose_covariance": unknown if pose_covariance is None else pose_covariance,
            "twist_covariance": unknown if twist_covariance is None else twist_covariance,
        },
    )


def observation_messages(observations: Observations) -> tuple[Stamps, list[bytes]]:
    """One `RangeBearingArray` per stamp, and the stamps (k,)."""
    make = typestore().types[RANGE_BEARING_TYPE]
    starts = observations.batch_starts
    # rosbags takes only contiguous arrays.
    range_m = np.ascontiguousarray(observations.range_m)
    bearing_rad = np.ascontiguousarray(observations.bearing_rad)
    messages = []
    for start, stop in pairwise(starts.tolist()):
        if start < stop:
            message = make(
                header=header(int(observations.t_ns[start]), "base_link"),
                landmark_id=observations.landmark_id[start:stop].astype(np.int32),
                range_m=range_m[start:stop],
                bearing_rad=bearing_rad[start:stop],
            )
            messages.append(serialised(message, RANGE_BEARING_TYPE))
    return observations.t_ns[starts[:-1]] if messages else observations.t_ns, messages


def vesc_state_message(theirs: object) -> bytes:
    """Telemetry in f1tenth's form from a `VescStateStamped` of any driver, older ones included.

    Fields that the other form has not are NaN, or 0 where they are integers.
    """
    store = typestore()
    state = getattr(theirs, "state", None)
    values: dict[str, float] = {}
    for name, (_, kind) in store.fielddefs[_VESC_STATE][1]:
        is_integer = kind[0] == "int32"
        value = getattr(state, name, 0 if is_integer else np.nan)
        values[name] = int(value) if is_integer else float(value)
    stamp = getattr(getattr(theirs, "header", None), "stamp", None)
    t_ns = getattr(stamp, "sec", 0) * NS_PER_S + getattr(stamp, "nanosec", 0)
    ours = store.types[VESC_STATE_TYPE](
        header=header(t_ns, "base_link"), state=store.types[_VESC_STATE](**values)
    )
    return serialised(ours, VESC_STATE_TYPE)


def split_stamps(t_ns: Stamps) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Whole seconds and the nanoseconds above them, as ROS keeps a time."""
    return np.floor_divide(t_ns, NS_PER_S), np.mod(t_ns, NS_PER_S)


def _empty_odometry() -> Msg:
    types = typestore().types
    geometry = {name: types[f"geometry_msgs/msg/{name}"] for name in _GEOMETRY}
    unknown: Floats = np.zeros(36)
    vector = geometry["Vector3"](x=0.0, y=0.0, z=0.0)
    pose = geometry["Pose"](
        position=geometry["Point"](x=0.0, y=0.0, z=0.0),
        orientation=geometry["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    twist = geometry["Twist"](linear=vector, angular=vector)
    return types[ODOMETRY_TYPE](
        header=header(0, "odom"),
        child_frame_id="base_link",
        pose=geometry["PoseWithCovariance"](pose=pose, covariance=unknown),
        twist=geometry["TwistWithCovariance"](twist=twist, covariance=unknown),
    )


_GEOMETRY = (
    "Point",
    "Pose",
    "PoseWithCovariance",
    "Quaternion",
    "Twist",
    "TwistWithCovariance",
    "Vector3",
)
