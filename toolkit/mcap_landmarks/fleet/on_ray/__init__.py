"""Workers on a cluster of Ray, which reads some of its settings while it loads: they are made here, before."""

import os

# Nobody is told over the network what is run here.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
# Set to either value, nothing is warned of: processes that asked for no GPU see those of their node.
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
# Ray would print what becomes of its processes among our results: none of those lines.
os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", ".")
