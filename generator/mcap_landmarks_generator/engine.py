"""PyBullet, imported without the line that it prints from C, which would stand between our own on stderr."""

import importlib
import os
from types import ModuleType


def _silently_imported() -> ModuleType:
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        return importlib.import_module("pybullet")
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


pybullet = _silently_imported()
