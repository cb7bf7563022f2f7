"""A Ray cluster of this machine for tests: two CPUs, its own folder, and no process is left of it."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
_START_S, _END_S = 180, 60  # six seconds each on a quiet machine


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port: int = listener.getsockname()[1]
        return port


@contextlib.contextmanager
def cluster(cpus: int = 2) -> Iterator[str]:
    """The address of a cluster that runs during the block, as `ray start --head` starts one.

    Its processes find the toolkit and the tests where this one does.
    """
    port, ports = free_port(), {name: free_port() for name in ("ray-client-server", "dashboard-agent-listen")}
    folder = tempfile.mkdtemp(prefix="ray", dir="/tmp")  # paths of sockets have 107 characters at most
    words = [sys.executable, "-m", "ray.scripts.scripts", "start", "--head", "--block", "--disable-usage-stats"]
    words += ["--node-ip-address", "127.0.0.1", "--port", str(port), "--num-cpus", str(cpus), "--temp-dir", folder]
    words += ["--include-dashboard", "false", "--object-store-memory", str(100 << 20)]
    words += [word for name, port_ in ports.items() for word in (f"--{name}-port", str(port_))]
    paths = os.pathsep.join([str(ROOT), str(ROOT / "toolkit"), str(ROOT / "generator"), *filter(None, sys.path)])
    env = {**os.environ, "PYTHONPATH": paths, "RAY_AUTH_MODE": "disabled", "RAY_USAGE_STATS_ENABLED": "0"}
    log = Path(folder) / "start.log"
    with log.open("wb") as out:
        head = subprocess.Popen(
            words, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=out, start_new_session=True
        )
    try:
        _wait(head, log)
        yield f"127.0.0.1:{port}"
    finally:
        with contextlib.suppress(subprocess.TimeoutExpired):
            head.terminate()
            head.wait(_END_S)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(head.pid, signal.SIGKILL)
        head.wait()
        shutil.rmtree(folder, ignore_errors=True)


def _wait(head: "subprocess.Popen[bytes]", log: Path) -> None:
    for _ in range(10 * _START_S):
        if "Ray runtime started" in log.read_text():
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            head.wait(0.1)
            break
    raise RuntimeError(f"no cluster: {log.read_text()}")
