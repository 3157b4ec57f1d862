"""What world and policies agree on: observation columns, codes, decisions from readings, the policy protocol."""
