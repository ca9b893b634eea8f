"""The backseat: one pure step from received frames to frames to send."""
