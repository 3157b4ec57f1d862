"""What a world is, as data: configurations, presets, quirks, regions of the floor."""
