"""What is varied: ladders of swarm sizes and adversity, study files, studies and their tables."""
