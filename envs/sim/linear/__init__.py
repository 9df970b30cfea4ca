"""A serial scope in linear time, compiled from the laws that every backend shares."""
