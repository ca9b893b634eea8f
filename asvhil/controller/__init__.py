"""Station keeping controllers, guidance, and the limits of the outputs."""
