"""Quality of service as ROS 2 writes it into a recording, so that any ROS 2 tool plays our channels."""

KEY = "offered_qos_profiles"
_FOREVER = "sec: 9223372036\n    nsec: 854775807"
# The numbers of humble's rmw/types.h; deadlines that never come are its largest duration.
_KEEP_LAST, _RELIABLE, _TRANSIENT_LOCAL, _VOLATILE, _AUTOMATIC = 1, 1, 1, 2, 1


def qos_profile(*, latched: bool = False, depth: int = 10) -> str:
    """YAML of one reliable profile with humble's numbers; latched messages reach those who subscribe later."""
    return (
        f"- history: {_KEEP_LAST}\n"
        f"  depth: {depth}\n"
        f"  reliability: {_RELIABLE}\n"
        f"  durability: {_TRANSIENT_LOCAL if latched else _VOLATILE}\n"
        f"  deadline:\n    {_FOREVER}\n"
        f"  lifespan:\n    {_FOREVER}\n"
        f"  liveliness: {_AUTOMATIC}\n"
        f"  liveliness_lease_duration:\n    {_FOREVER}\n"
        "  avoid_ros_namespace_conventions: false"
    )
