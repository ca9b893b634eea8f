"""Vessel models behind one protocol, for NumPy, CasADi and torch arrays."""
