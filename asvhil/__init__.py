"""asvhil: a hardware-in-the-loop MAVLink bridge for station keeping of small autonomous surface vehicles."""

__version__ = "0.1.0"
