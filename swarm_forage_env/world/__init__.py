"""The world: the order of a tick in `arena`, and one file for each thing that happens in it."""
