"""Measured rods and costs: the cable against published data, other rods and the clock."""
