"""The same swarm in the forms that other libraries ask for."""
