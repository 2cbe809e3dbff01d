"""Many steps of a run at once, in compiled loops."""
