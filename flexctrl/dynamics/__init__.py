"""Through time: integrators, simulation, trajectories."""
