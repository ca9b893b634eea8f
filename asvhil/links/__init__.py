"""Links of the daemon: endpoints, reconnection, MAVLink routing, signing keys."""
