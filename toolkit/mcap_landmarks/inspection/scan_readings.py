"""How the scans of a log are read, as the stages read them."""

from collections import Counter
from dataclasses import dataclass, field

from mcap_landmarks.errors import MessageError
from mcap_landmarks.lidar.scan_repair import ScanTopic
from mcap_landmarks.messages.scan import LaserScan, MultiEchoLaserScan


@dataclass(slots=True)
class ScanReadings:
    """How the scans of a topic that were looked at are read: what is repaired, and why others are refused, counted."""

    topic: ScanTopic = field(default_factory=ScanTopic)
    looked_at: int = 0
    repairs: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)

    def read(self, message: LaserScan | MultiEchoLaserScan) -> LaserScan | None:
        """A message as the stages read it, None if they do not."""
        self.looked_at += 1
        try:
            scan, repairs = self.topic.take(message)
        except MessageError as error:
            self.refusals[str(error)] += 1
            return None
        self.repairs.update(repairs)
        return scan
