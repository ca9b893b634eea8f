"""The optimal control problem of the MPC, and its solvers."""
