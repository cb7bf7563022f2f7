"""The MCAP container: the only package that knows its bytes."""
