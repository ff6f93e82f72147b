"""The cue protocol: what a simulator says to the motion server, byte for byte."""
