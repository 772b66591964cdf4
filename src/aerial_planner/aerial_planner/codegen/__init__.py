"""CasADi functions as machine code that evaluates many points at once."""
