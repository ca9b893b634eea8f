"""MAVLink: framing, signing, routing rules, time sync, streams, parameters."""
