"""Motions as data, and the contact schedule of a request."""
