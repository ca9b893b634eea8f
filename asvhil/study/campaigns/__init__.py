"""Campaigns: a design over config keys, its runs, their table, and what it says."""
