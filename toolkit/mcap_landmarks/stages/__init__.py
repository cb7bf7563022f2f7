"""The stages: one file each, of one shape, and those that packages bring; found by name, imported when asked for."""

from mcap_landmarks.extensions import Registry
from mcap_landmarks.stage import Reduction, Stage

STAGES: Registry[Stage | Reduction] = Registry(
    "stage", "stages", "STAGE", (Stage, Reduction), "mcap_landmarks.stages", beside="sources"
)


def stage_names() -> tuple[str, ...]:
    """Every stage in this folder and of packages; files whose name begins with an underscore are parts of stages."""
    return STAGES.names()


def find_stage(name: str) -> Stage | Reduction:
    """The declaration of a stage, imported now.

    Raises:
        ExtensionError: the package that brings it cannot be used.
    """
    return STAGES.find(name)


def usable_stages() -> list[Stage | Reduction]:
    """The declarations of all stages; of packages' those that can be used."""
    return [STAGES.own(name) for name in STAGES.usable()]
