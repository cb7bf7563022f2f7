"""How fast the generator records, where the time goes, and that its memory does not grow with the log.

python -m tests.benchmark.generator [--json] [--quick] [--against FOLDER]
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap_landmarks_generator.assets.backdrop import Backdrop
from mcap_landmarks_generator.camera import ImageJob
from mcap_landmarks_generator.checks import Staged, stage
from mcap_landmarks_generator.drawing import Drawing
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.optics import Optics
from mcap_landmarks_generator.record import record
from mcap_landmarks_generator.renderer import Renderer
from mcap_landmarks_generator.rendering import Photographer
from mcap_landmarks_generator.simulation import Simulation

from tests.benchmark.rows import Row, main

WORKERS = 2
QUICK_STOPS = 5
# Recorded by this checkout and another one in turn: so many stops, and how many times as fast this one is to be.
AGAINST = {"loop": (3, 1.5), "cluttered": (3, 2.0)}
ROUNDS = 3
PROFILED_IMAGES = 150
# A lap around three objects, driven once and ten times as often.
LAP = """\
objects = [
  { class = "fire hydrant", at = [2.0, 0.0], look = 1 },
  { class = "person", at = [0.0, 2.0], look = 2 },
  { class = "suitcase", at = [-2.0, 0.0], look = 3 },
]
[robot]
speed_factor = 4.0
[camera]
rate_hz = 3
[trajectory]
waypoints = [ { at = [1.0, 0.0] }, { at = [0.0, 1.0] }, { at = [-1.0, 0.0] }, { at = [0.0, -1.0] } ]
"""


def measure(quick: bool, against: Path | None = None) -> Iterator[Row]:
    """All rows; of a comparison only its own."""
    with tempfile.TemporaryDirectory() as folder:
        if against is not None:
            yield from compared(Path(folder), against, 1 if quick else ROUNDS)
            return
        yield from speed_of(Path(folder), quick)
        yield from memory(Path(folder), quick)
    for name in ("loop", "cluttered", "street"):
        yield from parts_of_an_image(name)


def compared(folder: Path, against: Path, rounds: int) -> Iterator[Row]:
    """Processor time of recording in one process, here and in another checkout, in turn: the least of each."""
    here = Path(__file__).parents[2]
    for name, (stops, goal) in AGAINST.items():
        times: dict[Path, list[float]] = {against: [], here: []}
        images = 0
        for _ in range(rounds):
            for checkout, spent in times.items():
                told = _recorded(checkout, name, stops, folder)
                spent.append(told["processor_s"])
                images = int(told["images"])
        best = {checkout: min(spent) for checkout, spent in times.items()}
        yield Row(
            f"{name}: times as fast as the other checkout",
            best[against] / best[here],
            "x",
            at_least=goal,
            cases=images,
            peers={"s": best[here], "s there": best[against]},
        )


def _recorded(checkout: Path, name: str, stops: int, folder: Path) -> dict[str, float]:
    """What `short_recording` tells, run with the packages of a checkout."""
    script = Path(__file__).with_name("short_recording.py")
    paths = os.pathsep.join(str(checkout.resolve() / part) for part in ("toolkit", "generator"))
    output = folder / "short.mcap"
    output.unlink(missing_ok=True)
    run = subprocess.run(
        [sys.executable, "-P", str(script), name, str(stops), str(output)],
        env={**os.environ, "PYTHONPATH": paths},
        check=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    told: dict[str, float] = json.loads(run.stdout)
    return told


def speed_of(folder: Path, quick: bool) -> Iterator[Row]:
    """Whole recordings."""
    start = time.perf_counter()
    record(stage(load_scenario("small")), folder / "small.mcap", WORKERS)
    yield Row("small: recorded in", time.perf_counter() - start, "s", at_most=60)
    staged = stage(load_scenario("loop"))
    if quick:
        way = staged.scenario.trajectory
        shorter = replace(way, waypoints=way.waypoints[:QUICK_STOPS])
        staged = replace(staged, scenario=replace(staged.scenario, trajectory=shorter))
    start = time.perf_counter()
    summary = record(staged, folder / "loop.mcap", WORKERS)
    took_s = time.perf_counter() - start
    images = summary.messages["/camera/image_raw/compressed"]
    label = f"loop, images at {staged.scenario.camera.rate_hz:g} Hz, {WORKERS} workers"
    yield Row(
        f"{label}: simulated over real time", summary.simulated_s / took_s, "x real time", at_least=3, cases=images
    )
    yield Row(f"{label}: images", images / took_s, "1/s", cases=images)
    yield Row("loop: simulation alone over real time", _simulation_alone(staged), "x real time")
    street = stage(load_scenario("street"))
    start = time.perf_counter()
    summary = record(street, folder / "street.mcap", WORKERS)
    real_time = summary.simulated_s / (time.perf_counter() - start)
    label = f"street, 16 rings and images at 10 Hz, {WORKERS} workers"
    yield Row(f"{label}: simulated over real time", real_time, "x real time", at_least=0.9)
    yield Row("street: simulation alone over real time", _simulation_alone(street), "x real time")


def _simulation_alone(staged: Staged) -> float:
    start = time.perf_counter()
    simulation = Simulation(staged)
    for _ in simulation.run():
        pass
    return simulation.end_ns / 1e9 / (time.perf_counter() - start)


def memory(folder: Path, quick: bool) -> Iterator[Row]:
    """Largest memory of a process that records a log, and of one that records a log ten times as long."""
    path = folder / "lap.toml"
    path.write_text(LAP)
    short, long = (4, 40) if quick else (10, 100)
    peaks = [_peak_mib(path, laps, folder / "lap.mcap") for laps in (short, long)]
    yield Row("memory over a log ten times as long", peaks[1] / peaks[0], "x", at_most=1.1, cases=long)
    yield Row("memory of one process", peaks[1], "MiB")


def _peak_mib(scenario: Path, laps: int, output: Path) -> float:
    command = [sys.executable, "-c", "from mcap_landmarks.cli.main import run; run()", "generate", str(scenario)]
    options = ["-o", str(output), "--overwrite", "--workers", "1", "--set", f"trajectory.laps={laps}"]
    with subprocess.Popen([*command, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RuntimeError(f"recording {laps} laps exited with {child.returncode}")
    return usage.ru_maxrss / 1024


def parts_of_an_image(name: str) -> Iterator[Row]:
    """Processor time of one image and of its parts, and what there is to draw."""
    staged = stage(load_scenario(name))
    jobs = [event for event in _first(Simulation(staged).run()) if isinstance(event, ImageJob)]
    photographer = Photographer(staged)
    photographer.take(jobs[0])
    spent: dict[str, float] = defaultdict(float)
    parts: list[tuple[str, Any, str]] = [
        ("ground, shadows and sky", Backdrop, "view"),
        ("objects drawn", Drawing, "render"),
        ("what is hidden", Drawing, "mask"),
        ("blur and noise", Optics, "expose"),
        ("JPEG", Optics, "jpeg"),
    ]
    originals = [(owner, method, getattr(owner, method)) for _, owner, method in parts]
    for (label, owner, method), (*_, original) in zip(parts, originals, strict=True):
        setattr(owner, method, _timed(original, label, spent))
    try:
        start = time.process_time()
        for job in jobs:
            photographer.take(job)
        total = time.process_time() - start
    finally:
        for owner, method, original in originals:
            setattr(owner, method, original)
    yield Row(f"{name}: one image, processor time", total / len(jobs) * 1e3, "ms", cases=len(jobs))
    for label, *_ in parts:
        yield Row(f"{name}: {label}", spent[label] / len(jobs) * 1e3, "ms", cases=len(jobs))
    objects, triangles = _drawn(staged, jobs)
    yield Row(f"{name}: objects per image", objects, cases=len(jobs))
    yield Row(f"{name}: triangles per image", triangles, cases=len(jobs))


def _first(events: Iterator[Any]) -> Iterator[Any]:
    """Events up to the last image that is profiled."""
    images = 0
    for event in events:
        yield event
        images += isinstance(event, ImageJob)
        if images == PROFILED_IMAGES:
            return


def _timed(original: Callable[..., Any], label: str, spent: dict[str, float]) -> Callable[..., Any]:
    def wrapper(*arguments: object) -> object:
        start = time.process_time()
        result = original(*arguments)
        spent[label] += time.process_time() - start
        return result

    return wrapper


def _drawn(staged: Staged, jobs: list[ImageJob]) -> tuple[float, float]:
    """Mean numbers of objects and triangles that are in view."""
    objects, triangles = [], []
    renderer = Renderer(staged.scenario, staged.objects)
    for job in jobs[::10]:
        visible = renderer.draw(job.view).visible
        objects.append(len(visible))
        triangles.append(sum(len(part.faces) for one in visible for part in one.placed.asset.parts))
    return float(np.mean(objects)), float(np.mean(triangles))


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument("--against", type=Path, metavar="FOLDER", help="only compare with another checkout")
    return options


if __name__ == "__main__":
    sys.exit(main(measure, __doc__ or "", _options()))
