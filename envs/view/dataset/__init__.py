"""Data sets of pictures with every ground truth, in the formats that loaders of public sets read."""
