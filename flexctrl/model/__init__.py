"""The equations of a machine: coordinates, assembly, equilibrium, linearisation."""
