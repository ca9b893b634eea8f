"""State and wind estimation."""
