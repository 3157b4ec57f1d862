"""Scenarios as data: configurations, presets, quirks, regions of the floor."""
