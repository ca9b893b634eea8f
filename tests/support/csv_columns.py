"""A column map for CSV files of made-up runs."""

COLUMNS = """
time: {column: t, unit: s}
u: {column: u, unit: m/s}
v: {column: v, unit: m/s}
r: {column: r, unit: rad/s}
port: {column: left, unit: "1"}
starboard: {column: right, unit: "1"}
"""
