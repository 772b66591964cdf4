"""Benchmarks of running nodes, and the tables of all benchmarks."""
