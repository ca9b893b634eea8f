"""Whether the boat moves as it is told to: motors, compass, and the distance to the station."""
