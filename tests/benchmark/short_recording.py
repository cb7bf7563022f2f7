"""Records the first stops of a scenario in one process: tests.benchmark.generator runs it in other checkouts.

python tests/benchmark/short_recording.py SCENARIO STOPS OUT.mcap: prints the processor time and the images as JSON.
"""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.record import record


def main(name: str, stops: int, output: Path) -> None:
    """Record and tell; what is imported and read before counts for nothing."""
    staged = stage(load_scenario(name))
    way = staged.scenario.trajectory
    shorter = replace(way, waypoints=way.waypoints[:stops])
    staged = replace(staged, scenario=replace(staged.scenario, trajectory=shorter))
    start = time.process_time()
    summary = record(staged, output, 1)
    took_s = time.process_time() - start
    images = summary.messages["/camera/image_raw/compressed"]
    print(json.dumps({"processor_s": took_s, "images": images, "simulated_s": summary.simulated_s}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
