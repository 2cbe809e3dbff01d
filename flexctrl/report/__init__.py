"""One page that tells everything about a scene."""
