"""Training of vessel models on logs and CSV files."""
