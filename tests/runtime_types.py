"""The runtime type checker that tests put on every function and dataclass of haustra."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""Holds arguments and results to their annotations, array shapes included; an int may stand for a float."""
