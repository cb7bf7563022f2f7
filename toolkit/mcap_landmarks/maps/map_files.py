"""A landmark map from a file and to one, of whichever format the file's name stands for."""

from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, is_there
from mcap_landmarks.maps.database import read_map, write_map
from mcap_landmarks.maps.exchange import SUFFIXES, export_map, format_of, import_map
from mcap_landmarks.maps.model import LandmarkMap

_DATABASE = ".db"


def read_map_file(path: Location) -> LandmarkMap:
    """The map in a landmark database, or in a file that `landmarks import` takes.

    Raises:
        MapError: there is no such file, or no map in it.
    """
    return import_map(path, format_of(path)) if path.suffix.lower() in SUFFIXES else read_map(path)


def write_map_file(path: Location, landmark_map: LandmarkMap, *, overwrite: bool) -> None:
    """Write a map as a landmark database, or as `landmarks export` does, whole or not at all.

    Raises:
        UsageError: the name stands for no format, or there is a file already that is not to be overwritten.
        ToolkitError: the map has not what the format needs, or the file cannot be written.
    """
    if path.suffix.lower() not in {_DATABASE, *SUFFIXES}:
        known = ", ".join([_DATABASE, *SUFFIXES])
        raise UsageError(f"{path}: the name does not tell the format; let it end in one of {known}")
    if not overwrite and is_there(path):
        raise UsageError(f"{path}: there is a file already; give overwrite=True, or another name")
    if path.suffix.lower() in SUFFIXES:
        export_map(path, landmark_map, format_of(path))
    else:
        write_map(path, landmark_map)
