"""Quality of service as ROS 2 writes it into a recording, so that any ROS 2 tool plays our channels."""

import re

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


_NAMES = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "manual_by_node", "manual_by_topic", "unknown", "best_available"),
}
"""The policies of rmw/types.h by their numbers, as rmw/qos_string_conversions.h names them."""
_POLICY = re.compile(rf"\b({'|'.join(_NAMES)})(['\"]?: *)['\"]?(\w+)\b['\"]?")

_LATCHED = re.compile(r"\bdurability:\s*(?:1|transient_local)\s*$", re.MULTILINE)


def is_latched(text: str) -> bool:
    """Whether profiles let those who subscribe later have the last messages."""
    return _LATCHED.search(text) is not None


def is_named(text: str) -> bool:
    """Whether profiles have their policies by name, as from Jazzy on, and not by number."""
    return any(not found[3].isdecimal() for found in _POLICY.finditer(text))


def numbered(text: str) -> str:
    """Profiles with all policies by number, as every distribution before Jazzy reads them; unknown ones stay."""
    return _POLICY.sub(lambda found: found[1] + found[2] + _number(found[1], found[3]), text)


def named(text: str) -> str:
    """Profiles with all policies by name, as Jazzy and later read them; unknown ones stay."""
    return _POLICY.sub(lambda found: found[1] + found[2] + _name(found[1], found[3]), text)


def _number(policy: str, value: str) -> str:
    names = _NAMES[policy]
    return str(names.index(value)) if value in names else value


def _name(policy: str, value: str) -> str:
    names = _NAMES[policy]
    return names[int(value)] if value.isdecimal() and int(value) < len(names) else value
