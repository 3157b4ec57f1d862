"""From a name or a file to a policy; what a learned policy sees and does."""
