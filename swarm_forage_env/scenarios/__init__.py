"""Scenarios as data: configurations, presets, quirks, regions of the floor."""

SCENARIO_NAMES = (
    "warehouse_small",
    "warehouse_medium",
    "warehouse_dual",
    "warehouse_quad",
    "search_and_rescue",
    "classroom",
)
"""What `presets.scenario` takes, each a function of `presets`; the package registers them without importing it."""
