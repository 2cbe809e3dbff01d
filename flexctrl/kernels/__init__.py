"""Expressions and small parts of Python made into compiled code: what runs over all pieces of a machine."""
