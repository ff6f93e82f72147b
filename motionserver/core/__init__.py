"""Pure: numpy only; no clock, no socket, no logging."""
