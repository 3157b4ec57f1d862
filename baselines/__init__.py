"""The paper's controllers as scripted policies."""
