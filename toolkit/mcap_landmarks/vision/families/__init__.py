"""The detector families: one file each, of one shape, and those that packages bring; found by name.

They are imported when a model is opened.
"""

from mcap_landmarks.extensions import Registry
from mcap_landmarks.vision.family import Family

FAMILIES = Registry("family of detectors", "vision/families", "FAMILY", (Family,), "mcap_landmarks.detectors")


def family_names() -> tuple[str, ...]:
    """Every family in this folder and of packages; files that begin with an underscore are parts of families."""
    return FAMILIES.names()


def find_family(name: str) -> Family:
    """The declaration of a family, imported now.

    Raises:
        ExtensionError: the package that brings it cannot be used.
    """
    return FAMILIES.find(name)
