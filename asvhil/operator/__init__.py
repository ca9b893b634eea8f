"""Commands, reports and parameters of operators over MAVLink."""
