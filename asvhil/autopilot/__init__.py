"""The conversation with the autopilot: profiles, ways to the motors, parameter requirements, readback."""
