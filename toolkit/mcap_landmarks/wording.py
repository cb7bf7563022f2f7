"""How counts are written for people, everywhere alike."""


def counted(count: int, noun: str) -> str:
    """A count with its noun, which is given for one: `1 bundle`, `2 bundles`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def tallied(count: int, what: str) -> str:
    """A count of what is already named for many, such as `images left out by --every`; of one it stands behind."""
    return f"{what}: 1" if count == 1 else f"{count} {what}"
