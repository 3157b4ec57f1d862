"""The paper's four controllers; nothing is imported here, so that everybody can ask."""

PAPER_POLICIES = ("crw", "dpo", "stochm", "stochx")
"""The names under which they are registered."""
