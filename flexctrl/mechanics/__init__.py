"""How a piece moves: pure functions."""
