"""Runs as data: specification, execution, storage, many at once."""
