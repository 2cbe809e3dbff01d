"""Which physics a scene asks for: one effect a file."""
