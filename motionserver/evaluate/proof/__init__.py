"""The motion states as a model that SPIN checks, written from the table that the guard uses."""
