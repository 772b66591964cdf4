"""Tasks and their null-space hierarchy, thesis (3.20)-(3.23)."""
