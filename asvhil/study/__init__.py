"""Studies: many simulated runs, their figures and tables."""
