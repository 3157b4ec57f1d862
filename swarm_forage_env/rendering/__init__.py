"""Pictures, films and plots; pure readers of the world."""
