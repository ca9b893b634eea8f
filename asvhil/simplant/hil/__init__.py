"""Servers of the simulator interfaces of ArduPilot and PX4."""
