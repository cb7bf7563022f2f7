"""A ROS 2 bag as output: a folder of recordings with the metadata.yaml by which ROS 2 finds and plays them."""

from collections import Counter
from itertools import chain
from pathlib import Path

from mcap_landmarks.atomic import atomic_file, atomic_folder
from mcap_landmarks.errors import UsageError
from mcap_landmarks.locations import Location, files_in
from mcap_landmarks.progress import Progress
from mcap_landmarks.runs.conversion import Converted, Job
from mcap_landmarks.runs.output_formats import OutputFormat
from mcap_landmarks.runs.replacing import IsEarlier, Replacing, output_to
from mcap_landmarks.runs.rosbag2_metadata import metadata_yaml
from mcap_landmarks.runs.split_outputs import write_parts
from mcap_landmarks.runs.splitting import Split

_METADATA = "metadata.yaml"
_STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")


def write_bag(job: Job, target: Location, split: Split | None, replacing: Replacing, advance: Progress) -> Converted:
    """Write a bag of the folder's name, in one file or several; a bag that is there may be replaced, no other folder.

    Raises:
        RecordingError: there is no message, or the bag cannot be written.
        UsageError: there is something else that has to stay.
    """
    if not target.name:
        raise UsageError(f"{target}: a bag has the name of its folder; add one to the URL")
    _check_bag(target)
    is_earlier = _earlier(replacing.is_earlier)
    with output_to(target, (), is_earlier, overwrite=replacing.overwrite, is_folder=True):
        with atomic_folder(target) as folder:
            parts = write_parts(job, folder / f"{target.name}.mcap", split, replacing, advance)
            with atomic_file(folder / _METADATA) as stream:
                stream.write(metadata_yaml(job.bag()).encode())
        return _as_one(target, parts)


def _check_bag(folder: Location) -> None:
    """Refuse to replace a folder with anything but a bag in it.

    Raises:
        UsageError: as it says.
    """
    for path in files_in(folder):
        is_deeper = path.is_dir() if isinstance(path, Path) else path != folder / path.name
        if is_deeper or not (path.name == _METADATA or path.name.endswith(_STORAGE)):
            raise UsageError(f"{folder} holds {path.name}, which is of no bag; give the bag a folder of its own name")


def _earlier(is_earlier: IsEarlier) -> IsEarlier:
    """Bags whose files all are earlier recordings; an empty folder is as good as none."""
    return lambda folder: all(is_earlier(path) for path in files_in(folder) if path.name != _METADATA)


def _as_one(target: Location, parts: list[Converted]) -> Converted:
    last = parts[-1]
    return Converted(
        target,
        OutputFormat.ROSBAG2,
        topics=sum((part.topics for part in parts), Counter()),
        declared=sum(part.declared for part in parts),
        lost=last.lost,
        dropped=last.dropped,
        losses=last.losses,
        notes=list(dict.fromkeys(chain.from_iterable(part.notes for part in parts))),
        left_out=last.left_out,
    )
