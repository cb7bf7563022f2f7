"""What is damaged in a recording, and what of it is lost: the one account that losses and notes are told from."""

from dataclasses import dataclass, replace

from mcap_landmarks.wording import counted


@dataclass(frozen=True, slots=True)
class SuspectChunk:
    """A chunk that cannot be trusted, which is left out. `messages` it should hold, None where nothing tells."""

    offset: int
    messages: int | None
    reason: str


@dataclass(frozen=True, slots=True)
class Stretch:
    """Bytes from `start` on and before `end` that were passed over, since there is no record in them, and why."""

    start: int
    end: int
    reason: str


@dataclass(frozen=True, slots=True)
class Damage:
    """The account of a recording.

    `expected` messages are those that the file itself tells of, None where nothing does; `recovered` those that can be
    had. `cut` says where the file is cut, `records` which other records are lost, `remarks` what is odd and costs
    nothing. `unverified` are chunks that no CRC proves, `is_cut_unverified` whether one of them has a CRC, which cannot
    be checked since the end of the file cuts it, `loose` runs of messages outside chunks, which have none, `duplicates`
    the places of chunks that were there before. `is_whole`: the statistics prove that everything arrived.
    """

    expected: int | None = None
    recovered: int = 0
    suspect_chunks: tuple[SuspectChunk, ...] = ()
    resyncs: tuple[Stretch, ...] = ()
    cut: str = ""
    records: tuple[str, ...] = ()
    unverified: int = 0
    is_cut_unverified: bool = False
    loose: int = 0
    duplicates: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()
    is_whole: bool = False
    crc_matches: bool | None = None

    @property
    def losses(self) -> list[str]:
        """In words, what cannot be read."""
        found = [_suspect(chunk) for chunk in self.suspect_chunks]
        if not self.is_whole:
            found += [_passed_over(stretch) for stretch in self.resyncs]
        found += [self.cut] if self.cut else []
        found += self.records
        if self.crc_matches is False and self.unverified + self.loose:
            found.append("the CRC over all data does not match, and messages have none of their own: some may be wrong")
        missing = (self.expected or 0) - self.recovered
        if missing > 0 and not found:
            found.append(f"{missing} of {counted(self.expected or 0, 'message')} that its statistics count are missing")
        return found

    @property
    def notes(self) -> list[str]:
        """In words, what is odd and costs nothing."""
        found = list(self.remarks)
        if self.is_whole:
            found += [f"{_passed_over(stretch)}; no message is lost by that" for stretch in self.resyncs]
        if without := self.unverified - self.is_cut_unverified:
            their = "its" if without == 1 else "their"
            found.append(f"{counted(without, 'chunk')} without a CRC: nothing verifies {their} messages")
        if self.is_cut_unverified:
            found.append("the CRC of the chunk that the end of the file cuts cannot be checked")
        if self.loose:
            found.append("messages outside chunks have no CRC: nothing verifies them")
        if self.duplicates:
            places = ", ".join(map(str, self.duplicates[:5])) + (" ..." if len(self.duplicates) > 5 else "")
            found.append(f"{counted(len(self.duplicates), 'chunk')} that came before, at byte {places}, counted once")
        if self.crc_matches is False and not self.unverified + self.loose:
            found.append("the CRC over all data does not match; every chunk was checked by its own")
        return found

    def with_suspect(self, chunk: SuspectChunk) -> "Damage":
        """The account with a chunk that proved damaged when it was read."""
        if chunk in self.suspect_chunks:
            return self
        recovered = self.recovered - (chunk.messages or 0)
        return replace(self, recovered=recovered, suspect_chunks=(*self.suspect_chunks, chunk), is_whole=False)


def _suspect(chunk: SuspectChunk) -> str:
    what = "its messages" if chunk.messages is None else f"its {counted(chunk.messages, 'message')}"
    are = "is" if chunk.messages == 1 else "are"
    return f"the chunk at byte {chunk.offset} is damaged ({chunk.reason}); {what} {are} left out"


def _passed_over(stretch: Stretch) -> str:
    return (
        f"{counted(stretch.end - stretch.start, 'byte')} passed over from byte {stretch.start} to byte {stretch.end} "
        f"({stretch.reason})"
    )
