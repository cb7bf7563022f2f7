"""Landmark maps and positions from robot recordings, offline and without ROS."""

__version__: str


def __getattr__(name: str) -> str:
    """The version, looked up when it is asked for: that takes longer than the command has until it heeds signals."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version  # noqa: PLC0415 - as said

    return version("mcap-landmarks")
