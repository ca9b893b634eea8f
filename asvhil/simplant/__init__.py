"""The simulated boat as a vehicle on the network, and as the physics of an autopilot in the loop."""
