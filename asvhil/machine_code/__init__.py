"""CasADi functions as machine code, where the computer has a C compiler: equal results in less time."""
