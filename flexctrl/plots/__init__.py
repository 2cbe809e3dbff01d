"""Axes in, axes out; the only importer of matplotlib."""
