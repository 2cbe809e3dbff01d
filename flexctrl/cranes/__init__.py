"""Ready-made machines with sourced parameters."""
