"""The one error tree: every message says what was wrong, where, and what to do about it."""


class ToolkitError(Exception):
    """Something the user can act on. The command line prints it in one line and exits with `exit_code`."""

    exit_code = 1


class UsageError(ToolkitError):
    """The command was asked for something that makes no sense: wrong option, ambiguous topic, missing input."""

    exit_code = 2


class RecordingError(ToolkitError):
    """A recording, bag or data set cannot be read or written."""


class MessageError(ToolkitError):
    """The bytes of one message do not fit its declared type."""


class MapError(ToolkitError):
    """A landmark database is missing, damaged, of another schema version, or too poor to use."""


class ModelError(ToolkitError):
    """An ONNX file is missing, cannot be run, or is no model of the kind that is needed."""


class ExtensionError(ToolkitError):
    """An installed package that brings a stage, a detector family or a source of its own cannot be used."""


class RemoteError(ToolkitError):
    """A file elsewhere, named by a URL, is missing, may not be used, or cannot be reached."""


class LossWarning(UserWarning):
    """Something of a log could not be read, and is missing in what was made of it; of the Python API alone."""
