"""Other methods: explicit, in momenta, extrapolated; what they share."""
