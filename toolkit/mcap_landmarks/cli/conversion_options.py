"""Options of `convert`: what is taken of the logs, and how it is written."""

import dataclasses
import re
from typing import TYPE_CHECKING, Annotated

import typer

from mcap_landmarks.cli import options
from mcap_landmarks.errors import UsageError
from mcap_landmarks.moments import time_ns

if TYPE_CHECKING:
    from mcap_landmarks.recording.chunk_form import ChunkForm
    from mcap_landmarks.runs.output_formats import OutputForm
    from mcap_landmarks.runs.splitting import Split
    from mcap_landmarks.runs.topic_selection import Selection

Topics = Annotated[
    list[str] | None, typer.Option("--topics", metavar="REGEX", help="Only topics that match whole; repeatable.")
]
Exclude = Annotated[
    list[str] | None, typer.Option("--exclude", metavar="REGEX", help="Leave out topics that match whole; repeatable.")
]
Types = Annotated[
    list[str] | None, typer.Option("--types", metavar="REGEX", help="Only topics whose type matches whole; repeatable.")
]
Rename = Annotated[
    list[str] | None, typer.Option("--remap", metavar="FROM=TO", help="Write topic FROM as TO; repeatable.")
]
SplitSize = Annotated[
    str | None,
    typer.Option("--split-size", metavar="SIZE", help="Several files of about 500M, 2G, ..., in a folder."),
]
SplitDuration = Annotated[
    float | None,
    typer.Option("--split-duration", metavar="SECONDS", help="Several files, each of so much time."),
]
SplitCount = Annotated[
    int | None, typer.Option("--split-count", metavar="N", help="Several files of at most N messages, in a folder.")
]
ChunkSize = Annotated[
    str | None, typer.Option("--chunk-size", metavar="SIZE", help="Write all chunks anew, of about 256K, 4M, ...")
]
Compression = Annotated[
    str | None,
    typer.Option(
        "--compression", metavar="zstd|lz4|none", help="Write all chunks anew, so compressed; bags: lz4, bz2."
    ),
]

To = Annotated[str, typer.Option("--to", metavar="mcap|rosbag2|bag", help="rosbag2 is a folder, bag of ROS 1.")]
OutputName = Annotated[
    str,
    typer.Option("-o", "--output", metavar="OUT", help="A file NAME.mcap, or a folder; see --to."),
]
"""As text: a slash at its end says that it is a folder."""


@dataclasses.dataclass(frozen=True, slots=True)
class SelectionOptions:
    """What is taken of the logs."""

    topics: Topics = None
    exclude: Exclude = None
    types: Types = None
    remap: Rename = None
    start: options.Start = None
    end: options.End = None

    def selection(self) -> "Selection":
        """What was chosen.

        Raises:
            UsageError: an option cannot be read.
        """
        from mcap_landmarks.runs.topic_selection import Selection

        remap = {}
        if self.remap:
            from mcap_landmarks.inspection.topic_roles import parse_remaps

            remap = parse_remaps(self.remap)
        return Selection(
            tuple(self.topics or ()),
            time_ns(self.start, "--start"),
            time_ns(self.end, "--end"),
            tuple(self.exclude or ()),
            tuple(self.types or ()),
            tuple(remap.items()),
        )


@dataclasses.dataclass(frozen=True, slots=True)
class FormOptions:
    """How it is written."""

    split_size: SplitSize = None
    split_duration: SplitDuration = None
    split_count: SplitCount = None
    chunk_size: ChunkSize = None
    compression: Compression = None
    to: To = "mcap"

    def output(self, *, names_folder: bool) -> "OutputForm":
        """How outputs are written, whose name may say that it is a folder's.

        Raises:
            UsageError: an option cannot be read.
        """
        from mcap_landmarks.runs.output_formats import OutputForm, OutputFormat

        if self.to not in set(OutputFormat):
            raise UsageError(f"--to {self.to}: choose mcap, rosbag2 or bag")
        return OutputForm(self.split(), self.form(), OutputFormat(self.to), names_folder=names_folder)

    def split(self) -> "Split | None":
        """Where outputs end, None for nowhere.

        Raises:
            UsageError: an option cannot be read, or two are given.
        """
        from mcap_landmarks.runs.splitting import Split

        given = [name for name in ("split_size", "split_duration", "split_count") if getattr(self, name) is not None]
        if len(given) > 1:
            raise UsageError(f"{' and '.join('--' + name.replace('_', '-') for name in given)}: give one of them")
        if self.split_size is not None:
            return Split(size_bytes=size_bytes(self.split_size, "--split-size"))
        if self.split_duration is not None:
            if not 0 < self.split_duration < _LONGEST_S:
                raise UsageError(f"--split-duration {self.split_duration}: give seconds, more than none")
            return Split(duration_ns=max(round(self.split_duration * 1e9), 1))
        if self.split_count is not None:
            if self.split_count < 1:
                raise UsageError(f"--split-count {self.split_count}: give a number of messages, at least 1")
            return Split(count=self.split_count)
        return None

    def form(self) -> "ChunkForm | None":
        """How chunks are to look, None where those of the logs may stay.

        Raises:
            UsageError: an option cannot be read.
        """
        from mcap_landmarks.recording.chunk_form import CHUNK_BYTES, ChunkForm

        known = ("lz4", "bz2", "none") if self.to == "bag" else ("zstd", "lz4", "none")
        if self.compression not in {None, *known}:
            raise UsageError(f"--compression {self.compression}: choose {', '.join(known[:-1])} or none")
        if self.chunk_size is None and self.compression is None:
            return None
        size = CHUNK_BYTES if self.chunk_size is None else size_bytes(self.chunk_size, "--chunk-size")
        if size > LARGEST_CHUNK_BYTES:
            raise UsageError(f"--chunk-size {self.chunk_size}: at most 64M; readers hold whole chunks in memory")
        default = "none" if self.to == "bag" else "zstd"
        return ChunkForm(self.compression or default, size, is_for_images=self.compression is not None)


_LONGEST_S = 2**63 / 1e9
"""What fits into the times of recordings."""
LARGEST_CHUNK_BYTES = 64 << 20
"""Recorders write chunks of 768 KiB to a few MiB; a reader that merges overlapping ones holds several of them."""


def size_bytes(text: str, option: str) -> int:
    """A number of bytes, such as 500M or 256K.

    Raises:
        UsageError: the text is none.
    """
    found = re.fullmatch(r"(\d+)([kKMG]?)", text)
    if not found or not int(found[1]):
        raise UsageError(f"{option} {text}: give bytes, such as 500M, 256K or 2G")
    return int(found[1]) << {"": 0, "K": 10, "M": 20, "G": 30}[found[2].upper()]
