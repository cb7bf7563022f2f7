"""What tells SQLite files of ours apart: an application id in their header (SQLite file format, 1.3.17)."""

AT = 68
"""Where it stands, in big endian."""
LANDMARKS = b"MCLM"
"""That of landmark databases; catalogues have none."""
