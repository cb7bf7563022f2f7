"""Make the demo's recordings: two drives through a small world, seen by camera and LiDAR, with drifting odometry.

`python recordings/make_demo.py [FOLDER]` drives the scenarios beside this file and writes demo_map.mcap and
demo_localize.mcap, the same bytes every time on one machine type. Truth goes to channels that no stage reads.
"""

import os
import sys
from pathlib import Path

from mcap_landmarks_generator.checks import stage
from mcap_landmarks_generator.loading import load_scenario
from mcap_landmarks_generator.record import record

HERE = Path(__file__).resolve().parent


def main(folder: Path) -> None:
    """Write both recordings."""
    for name in ("demo_map", "demo_localize"):
        staged = stage(load_scenario(str(HERE / f"{name}.toml"), [], None))
        record(staged, folder / f"{name}.mcap", os.cpu_count() or 1)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
