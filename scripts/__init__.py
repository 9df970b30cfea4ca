"""The command `haustra`, one file a verb."""
