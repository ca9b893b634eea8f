"""Common parts of the simulated autopilots."""
