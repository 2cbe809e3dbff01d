"""Laws of force, as kernels and where they switch."""
