"""MCAP logs: recording, reading, replay, and the figures of a run."""
