"""Linear models through time: integrated exactly."""
