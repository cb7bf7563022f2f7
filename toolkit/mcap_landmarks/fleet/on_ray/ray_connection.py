"""The way to a Ray cluster and back: what is wrong with an address, in words."""

import contextlib
import logging
import os
import signal
import socket
import threading
import warnings
from collections.abc import Iterator
from functools import partial

import ray

from mcap_landmarks.errors import ToolkitError, UsageError

_AUTO, _LOCAL, _CLIENT = "auto", "local", "ray://"
_STORE_BYTES = 100 << 20
"""Of a cluster of our own, whose object store has nothing but the words of tasks: near the least that Ray takes."""
_ANSWER_S = 10.0
"""How long a host may take to answer at all; Ray itself tries for minutes."""


@contextlib.contextmanager
def connected(address: str, cpus: int | None = None) -> Iterator[None]:
    """Be a driver of the cluster at an address while the block runs; `local` starts one of so many `cpus` for it.

    Where this process is one already, that connection is used, and stays.

    Raises:
        UsageError: the address is none.
        ToolkitError: the cluster does not answer, or has another version of Ray or Python.
    """
    if ray.is_initialized():
        yield
        return
    _check_answer(address)
    with _signals_as_before(), warnings.catch_warnings(action="ignore"):
        _connect(address, cpus)
    try:
        yield
    finally:
        ray.shutdown()


def _check_answer(address: str) -> None:
    if address in (_AUTO, _LOCAL):
        return
    host, colon, port = address.removeprefix(_CLIENT).rpartition(":")
    if not (host and colon and port.isdecimal()):
        raise UsageError(f"--ray {address}: name a cluster as auto, HOST:PORT or ray://HOST:PORT, or take local")
    try:
        socket.create_connection((host, int(port)), _ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise ToolkitError(f"--ray {address}: nobody answers there ({error}); {_remedy(address, '')}") from error


def _connect(address: str, cpus: int | None) -> None:
    start = partial(ray.init, log_to_driver=False, logging_level=logging.CRITICAL)
    try:
        if address == _LOCAL:
            count = cpus or len(os.sched_getaffinity(0))
            start(_LOCAL, num_cpus=count, include_dashboard=False, object_store_memory=_STORE_BYTES)
        else:
            start(address)
    except ImportError as error:
        raise ToolkitError(f"--ray {address}: {error}; pip install 'ray[client]'") from error
    except (OSError, RuntimeError, ValueError, AssertionError, TypeError) as error:
        told = " ".join(str(error).split()).rstrip(".") or type(error).__name__
        raise ToolkitError(f"--ray {address}: {told}; {_remedy(address, f'{told} {error.__cause__}')}") from error


def _remedy(address: str, told: str) -> str:
    if "ersion mismatch" in told:
        return "install the same versions of Python and Ray on all nodes"
    if "AuthToken" in told:
        return "set RAY_AUTH_MODE=token, and the cluster's token as RAY_AUTH_TOKEN"
    if address == _LOCAL:
        return "free memory and space in /tmp, or name a cluster"
    if address.startswith(_CLIENT):
        return "check host and port (10001 by default), and that the head node runs a client server"
    return "check that `ray status` answers on this machine, which must be one of its nodes; else take ray://HOST:10001"


@contextlib.contextmanager
def _signals_as_before() -> Iterator[None]:
    """Keep the ways of the command line with signals: Ray puts its own in their place."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, how in before.items():
            signal.signal(number, how)
