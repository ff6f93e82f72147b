"""What this machine can promise, in plain words, and the command that mends each finding."""
