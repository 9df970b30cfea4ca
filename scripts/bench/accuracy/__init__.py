"""Run time against error: one file a question, all answered as fronts, tables and criteria."""
