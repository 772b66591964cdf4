"""Timing tables: how long the parts take, how often they succeed, next to peers and to the thesis's own formulation."""
