"""PyBullet, imported without the line that it prints from C, which would stand between our own on stderr."""

import os
from typing import Any


def _silently_imported() -> Any:  # noqa: ANN401 - PyBullet has no types
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        import pybullet as module  # noqa: PLC0415 - between the two redirections
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
    return module


pybullet = _silently_imported()
