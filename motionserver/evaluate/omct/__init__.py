"""Objective motion cueing test: frequency responses of the whole server, sine by sine."""
