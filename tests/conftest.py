"""Settings shared by all tests."""

from hypothesis import settings

# Same examples on every machine and no time limit per example: a red test means a defect, not bad luck.
settings.register_profile("reproducible", derandomize=True, deadline=None)
settings.load_profile("reproducible")
