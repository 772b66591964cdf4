"""The force optimization, thesis (3.24)."""
