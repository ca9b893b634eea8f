"""Names of the ports that frames come from and go to: the keys of their links in the config.

Sensors in `links.sensors` have the port names that the config gives them.
"""

AUTOPILOT = "autopilot"
OPERATOR = "operator"
ANEMOMETER = "anemometer"
GNSS = "gnss"
INS = "ins"
GROUND = "ground."  # and the name of a ground station's link
