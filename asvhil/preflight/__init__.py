"""What should be seen before the boat leaves the dock: `asvhil check`."""
