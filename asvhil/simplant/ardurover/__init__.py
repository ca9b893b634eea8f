"""The simulated ArduRover."""
