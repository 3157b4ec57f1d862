"""What the world and the policies share: observation columns, codes, decisions from readings, the policy protocol."""
