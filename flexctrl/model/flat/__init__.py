"""Models on flat vectors, for compiled loops."""
