"""Runs and studies: specification, execution, storage."""
