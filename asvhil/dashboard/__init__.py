"""The operator's page: a process of its own that asks the daemon how it is, and serves what it hears to browsers."""
