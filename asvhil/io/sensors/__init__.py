"""Sensor codecs, the choice among sources, and the decoder of all measurements."""
