"""What moves faster than steps see: how a run sets out, and how steps are solved over it."""
