"""The equations: coordinates, assembly, equilibrium, linear models and their reduction."""
