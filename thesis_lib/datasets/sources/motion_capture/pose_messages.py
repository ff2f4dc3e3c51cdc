"""ROS messages that hold poses or points: the content of each type, and definitions of types that rosbags lacks.

A message describes one body, or several by name or number.  A point gets a quaternion of zeros: it has no orientation.
"""

from collections.abc import Callable, Iterable

TRANSFORMS = "tf2_msgs/msg/TFMessage"
Pose = tuple[float, float, float, float, float, float, float]  # x, y, z in m and the quaternion x, y, z, w
Told = tuple[str, str, int, Pose]  # name of the body, frame of the recording, stamp in ns or 0, pose


def _seven(p, q) -> Pose:
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _pose(pose) -> Pose:
    return _seven(pose.position, pose.orientation)


def _point(p) -> Pose:
    return p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0


def _ns(header) -> int:
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _one(message, pose: Pose) -> list[Told]:
    return [("", message.header.frame_id, _ns(message.header), pose)]


def _many(message, named: Iterable[tuple[object, Pose]]) -> list[Told]:
    return [(str(name), message.header.frame_id, _ns(message.header), pose) for name, pose in named]


def _transforms(messages) -> list[Told]:
    told = ((one.child_frame_id, one.header, one.transform) for one in messages)
    return [(name, head.frame_id, _ns(head), _seven(of.translation, of.rotation)) for name, head, of in told]


KINDS: dict[str, Callable[..., list[Told]]] = {
    "geometry_msgs/msg/Pose": lambda m: [("", "", 0, _pose(m))],
    "geometry_msgs/msg/PoseStamped": lambda m: _one(m, _pose(m.pose)),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _one(m, _pose(m.pose.pose)),
    "geometry_msgs/msg/PoseArray": lambda m: _many(m, ((i, _pose(pose)) for i, pose in enumerate(m.poses))),
    "nav_msgs/msg/Odometry": lambda m: _one(m, _pose(m.pose.pose)),
    "geometry_msgs/msg/TransformStamped": lambda m: _transforms([m]),
    TRANSFORMS: lambda m: _transforms(m.transforms),
    "geometry_msgs/msg/Point": lambda m: [("", "", 0, _point(m))],
    "geometry_msgs/msg/PointStamped": lambda m: _one(m, _point(m.point)),
    "motion_capture_tracking_interfaces/msg/NamedPoseArray": lambda m: _many(
        m, ((one.name, _pose(one.pose)) for one in m.poses)
    ),
    "mocap4r2_msgs/msg/RigidBodies": lambda m: _many(
        m, ((one.rigid_body_name, _pose(one.pose)) for one in m.rigidbodies)
    ),
    "ar_track_alvar_msgs/msg/AlvarMarkers": lambda m: [
        (str(one.id), one.header.frame_id, _ns(one.header) or _ns(m.header), _pose(one.pose.pose)) for one in m.markers
    ],
    "aruco_msgs/msg/MarkerArray": lambda m: _many(m, ((one.id, _pose(one.pose.pose)) for one in m.markers)),
    "apriltag_ros/msg/AprilTagDetectionArray": lambda m: _many(
        m, (("-".join(map(str, one.id)), _pose(one.pose.pose.pose)) for one in m.detections)
    ),
    "gazebo_msgs/msg/ModelStates": lambda m: [(name, "", 0, _pose(pose)) for name, pose in zip(m.name, m.pose)],
}
_SEPARATOR = "=" * 80 + "\nMSG: "
DEFINITIONS = {  # type that rosbags lacks -> its definition, as published by its package
    TRANSFORMS: "geometry_msgs/TransformStamped[] transforms",
    "motion_capture_tracking_interfaces/msg/NamedPoseArray": "std_msgs/Header header\nNamedPose[] poses\n"
    f"{_SEPARATOR}motion_capture_tracking_interfaces/NamedPose\nstring name\ngeometry_msgs/Pose pose",
    "mocap4r2_msgs/msg/RigidBodies": "std_msgs/Header header\nuint32 frame_number\nRigidBody[] rigidbodies\n"
    f"{_SEPARATOR}mocap4r2_msgs/RigidBody\nstring rigid_body_name\nMarker[] markers\ngeometry_msgs/Pose pose\n"
    f"{_SEPARATOR}mocap4r2_msgs/Marker\nint8 USE_NAME=0\nint8 USE_INDEX=1\nint8 USE_BOTH=2\nint8 id_type\n"
    "int32 marker_index\nstring marker_name\ngeometry_msgs/Point translation",
    "ar_track_alvar_msgs/msg/AlvarMarkers": "std_msgs/Header header\nAlvarMarker[] markers\n"
    f"{_SEPARATOR}ar_track_alvar_msgs/AlvarMarker\nstd_msgs/Header header\nuint32 id\nuint32 confidence\n"
    "geometry_msgs/PoseStamped pose",
    "aruco_msgs/msg/MarkerArray": "std_msgs/Header header\nMarker[] markers\n"
    f"{_SEPARATOR}aruco_msgs/Marker\nstd_msgs/Header header\nuint32 id\ngeometry_msgs/PoseWithCovariance pose\n"
    "float64 confidence",
    "apriltag_ros/msg/AprilTagDetectionArray": "std_msgs/Header header\nAprilTagDetection[] detections\n"
    f"{_SEPARATOR}apriltag_ros/AprilTagDetection\nint32[] id\nfloat64[] size\n"
    "geometry_msgs/PoseWithCovarianceStamped pose",
    "gazebo_msgs/msg/ModelStates": "string[] name\ngeometry_msgs/Pose[] pose\ngeometry_msgs/Twist[] twist",
}
