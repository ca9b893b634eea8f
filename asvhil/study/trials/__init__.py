"""Single simulated runs that studies consist of."""
