"""The serial protocol of VectorNav's inertial sensors (VN-300): binary output messages and ASCII sentences."""
