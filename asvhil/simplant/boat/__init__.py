"""The boat itself: motion, weather, sensors and their faults."""
