"""Paths of equilibria under growing loads."""
