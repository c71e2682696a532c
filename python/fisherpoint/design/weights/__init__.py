"""The best weights of given candidates."""
