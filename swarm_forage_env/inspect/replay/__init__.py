"""Replays: runs as arrays of what happened where and when, and the page in which people look into them."""
