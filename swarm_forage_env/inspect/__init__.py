"""What people look at: films, replays, maps, the window."""
