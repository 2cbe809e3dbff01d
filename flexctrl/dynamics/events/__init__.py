"""What happens on the way: events, corners of laws of force, impacts; where they are and how steps end there."""
