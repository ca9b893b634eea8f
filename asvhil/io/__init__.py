"""Codecs without input or output of their own (sans-IO): bytes to data and back."""
