"""What the machine is: frozen data in SI units, checked once, no numerics."""
